//! The footer of a table, looked through before the `parquet` crate reads it.
//!
//! The crate (60.1) skips fields that it does not know, and believes the count of a list in them: a broken byte makes it step
//! through a billion elements that take no bytes, for seconds. Every element takes a byte at least, so such a count is refused.
//!
//! Source: Apache Thrift, doc/specs/thrift-compact-protocol.md.

use crate::error::Result;
use crate::input::Input;
use std::io::{Read, Seek, SeekFrom};

/// Length of the footer and the mark behind it.
const END: usize = 8;

/// Levels of fields in fields; the crate itself goes no deeper.
const DEEPEST: usize = 64;

/// Whether the footer claims more elements than it has bytes. What else may be wrong in it is left to its reader.
///
/// # Errors
/// A file that can't be read.
pub(super) fn claims_too_much(input: &Input) -> Result<bool> {
    let failed = |e| input.failed(e);
    let Some(end) = input.len()?.checked_sub(END as u64) else { return Ok(false) };
    let mut file = input.open()?;
    let mut mark = [0; END];
    file.seek(SeekFrom::Start(end)).map_err(failed)?;
    file.read_exact(&mut mark).map_err(failed)?;
    let length = u32::from_le_bytes([mark[0], mark[1], mark[2], mark[3]]);
    let Some(begin) = end.checked_sub(u64::from(length)) else { return Ok(false) };
    let mut bytes = vec![0; length as usize];
    file.seek(SeekFrom::Start(begin)).map_err(failed)?;
    file.read_exact(&mut bytes).map_err(failed)?;
    Ok(matches!(Walk(&bytes).fields(DEEPEST), Err(Why::TooMany)))
}

/// Why a walk ends early.
enum Why {
    TooMany,
    /// The bytes end, or are none of the protocol: the reader's own error says so.
    Other,
}

/// What is left of the bytes.
struct Walk<'a>(&'a [u8]);

impl Walk<'_> {
    fn byte(&mut self) -> std::result::Result<u8, Why> {
        let (first, rest) = self.0.split_first().ok_or(Why::Other)?;
        self.0 = rest;
        Ok(*first)
    }

    fn skip(&mut self, count: usize) -> std::result::Result<(), Why> {
        self.0 = self.0.get(count..).ok_or(Why::Other)?;
        Ok(())
    }

    /// Seven bits a byte, the lowest first.
    fn number(&mut self) -> std::result::Result<u64, Why> {
        let mut value = 0;
        for shift in (0..70).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(Why::Other)
    }

    fn count(&mut self, number: u64) -> std::result::Result<usize, Why> {
        usize::try_from(number).ok().filter(|count| *count <= self.0.len()).ok_or(Why::TooMany)
    }

    /// The fields of a struct up to its end.
    fn fields(&mut self, depth: usize) -> std::result::Result<(), Why> {
        loop {
            let head = self.byte()?;
            // The crate ends a struct at every head of this kind.
            if head & 15 == 0 {
                return Ok(());
            }
            if head >> 4 == 0 {
                self.number()?;
            }
            // The value of a truth stands in its type.
            if !matches!(head & 15, 1 | 2) {
                self.value(head & 15, depth)?;
            }
        }
    }

    fn value(&mut self, kind: u8, depth: usize) -> std::result::Result<(), Why> {
        let depth = depth.checked_sub(1).ok_or(Why::Other)?;
        match kind {
            // The crate takes no byte for a truth in a list, the protocol one; no footer has such a list.
            1 | 2 => Err(Why::TooMany),
            3 => self.skip(1),
            4..=6 => self.number().map(|_| ()),
            7 => self.skip(8),
            8 => {
                let count = self.number()?;
                self.skip(usize::try_from(count).map_err(|_| Why::Other)?)
            }
            9 | 10 => {
                let head = self.byte()?;
                let number = if head >> 4 == 15 { self.number()? } else { u64::from(head >> 4) };
                for _ in 0..self.count(number)? {
                    self.value(head & 15, depth)?;
                }
                Ok(())
            }
            11 => {
                let number = self.number()?;
                if number == 0 {
                    return Ok(());
                }
                let kinds = self.byte()?;
                for _ in 0..self.count(number)? {
                    self.value(kinds >> 4, depth)?;
                    self.value(kinds & 15, depth)?;
                }
                Ok(())
            }
            12 => self.fields(depth),
            13 => self.skip(16),
            _ => Err(Why::Other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file that ends with this footer.
    fn claims(footer: &[u8]) -> bool {
        let length = (footer.len() as u32).to_le_bytes();
        claims_too_much(&Input::of_bytes("a", &[b"PAR1", footer, &length, b"PAR1"].concat())).unwrap()
    }

    #[test]
    fn a_list_longer_than_the_footer_is_found_and_others_are_not() {
        // Field 1: a list of 2^28 truths, of two bytes, of none.
        assert!(claims(&[0x19, 0xf1, 0x80, 0x80, 0x80, 0x80, 0x01, 0]));
        assert!(!claims(&[0x19, 0x23, 7, 8, 0]));
        assert!(!claims(&[0x19, 0x03, 0]));
        // In a struct within a map within a list.
        assert!(claims(&[0x19, 0x1b, 1, 0x3c, 5, 0x19, 0xf3, 0xff, 0xff, 0x7f, 0, 0]));
        // Truths in a list, on which the crate and the protocol disagree.
        assert!(claims(&[0x19, 0x21, 1, 1, 0]));
        // Cut, of an unknown kind, too deep, empty.
        assert!(!claims(&[0x19]) && !claims(&[0x1e, 0]) && !claims(&[0x1c; 200]) && !claims(&[]));
    }
}
