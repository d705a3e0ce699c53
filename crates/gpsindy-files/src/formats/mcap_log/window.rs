//! The part of a stream of bytes that is at hand, so that a record is read in place.

use crc32fast::Hasher;
use std::io::{self, BufRead, ErrorKind, Read};

/// Bytes of a stream in order.
#[derive(Debug)]
pub(super) struct Window<R> {
    pub(super) source: R,
    buffer: Vec<u8>,
    begin: usize,
    end: usize,
    /// Of all bytes that came from the source, where they are checked.
    hasher: Option<Hasher>,
}

impl<R: Read> Window<R> {
    /// A window on `source` in a buffer that is not empty; what the buffer holds does not count.
    pub(super) fn new(source: R, buffer: Vec<u8>, hasher: Option<Hasher>) -> Self {
        Self { source, buffer, begin: 0, end: 0, hasher }
    }

    /// The buffer for another window, and the checksum of what was read.
    pub(super) fn close(self) -> (Vec<u8>, Option<u32>) {
        (self.buffer, self.hasher.map(Hasher::finalize))
    }

    /// The bytes at hand.
    pub(super) fn at_hand(&self) -> &[u8] {
        &self.buffer[self.begin..self.end]
    }

    /// Reads until `count` bytes are at hand; `false` where the source ends before.
    ///
    /// The buffer grows with what comes and not with what is asked for: a broken length takes no memory.
    pub(super) fn load(&mut self, count: usize) -> io::Result<bool> {
        while self.end - self.begin < count {
            self.buffer.copy_within(self.begin..self.end, 0);
            (self.begin, self.end) = (0, self.end - self.begin);
            if self.end == self.buffer.len() {
                self.buffer.resize((2 * self.end).min(count), 0);
            }
            let read = again(|| self.source.read(&mut self.buffer[self.end..]))?;
            if read == 0 {
                return Ok(false);
            }
            self.took(self.end, read);
            self.end += read;
        }
        Ok(true)
    }

    /// Hands out the next `count` bytes, which are at hand.
    pub(super) fn cut(&mut self, count: usize) -> &[u8] {
        let begin = self.begin;
        self.begin += count;
        &self.buffer[begin..self.begin]
    }

    /// Goes on by `count` bytes, which need not be at hand; `false` where the source ends before.
    pub(super) fn skip(&mut self, mut count: u64) -> io::Result<bool> {
        loop {
            let step = usize::try_from(count).unwrap_or(usize::MAX).min(self.end - self.begin);
            self.begin += step;
            count -= step as u64;
            if count == 0 {
                return Ok(true);
            }
            if !self.load(1)? {
                return Ok(false);
            }
        }
    }

    fn took(&mut self, begin: usize, count: usize) {
        if let Some(hasher) = &mut self.hasher {
            hasher.update(&self.buffer[begin..begin + count]);
        }
    }
}

impl<R: Read> Read for Window<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        // Nothing at hand and much asked for: without a copy. No window that is read through checks its bytes.
        if self.begin == self.end && bytes.len() >= self.buffer.len() && self.hasher.is_none() {
            return self.source.read(bytes);
        }
        let count = self.fill_buf()?.len().min(bytes.len());
        bytes[..count].copy_from_slice(self.cut(count));
        Ok(count)
    }
}

impl<R: Read> BufRead for Window<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.load(1)?;
        Ok(self.at_hand())
    }

    fn consume(&mut self, count: usize) {
        self.begin += count;
    }
}

/// Reads again where a signal came between.
fn again(mut read: impl FnMut() -> io::Result<usize>) -> io::Result<usize> {
    loop {
        match read() {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_in_order_whatever_is_asked_for() {
        let bytes: Vec<u8> = (0..200).collect();
        let mut window = Window::new(bytes.as_slice(), vec![0; 16], Some(Hasher::new()));
        assert!(window.load(9).unwrap());
        assert_eq!(window.cut(9), &bytes[..9]);
        assert!(window.skip(40).unwrap());
        assert!(window.load(100).unwrap());
        assert_eq!(window.cut(100), &bytes[49..149]);
        assert!(!window.load(52).unwrap());
        assert_eq!(window.at_hand(), &bytes[149..]);
        assert_eq!(window.close().1, Some(crc32fast::hash(&bytes)));
    }

    #[test]
    fn a_length_beyond_the_end_takes_no_memory() {
        let mut window = Window::new(&[7_u8; 100][..], vec![0; 16], None);
        assert!(!window.load(usize::MAX / 4).unwrap());
        assert!(window.close().0.len() <= 256);
        let mut window = Window::new(&[7_u8; 100][..], vec![0; 16], None);
        assert!(!window.skip(u64::MAX).unwrap());
    }

    #[test]
    fn what_is_read_through_follows_what_was_taken() {
        let bytes: Vec<u8> = (0..200).collect();
        let mut window = Window::new(bytes.as_slice(), vec![0; 16], None);
        assert!(window.load(3).unwrap());
        window.cut(3);
        let mut rest = vec![0; 197];
        window.read_exact(&mut rest).unwrap();
        assert_eq!(rest, bytes[3..]);
    }
}
