//! Where the wanted numbers of a message are, kept for as long as messages have the same shape.
//!
//! The counts of arrays and texts, and the names in a list, decide where everything is. The messages of a topic nearly
//! always agree in them, so the places that were found in one serve for the next, without a walk through its fields.

use crate::formats::message::kind::{Kind, number};
use std::ops::Range;

/// Most parts of a message that decide its shape. Beyond, a comparison costs as much as a walk.
const MOST: usize = 64;

/// Walks in vain after which no more layouts are made, beyond the messages that were read by one.
const IN_VAIN: usize = 16;

/// What a walk through a message found.
#[derive(Debug, Clone, Default)]
pub(crate) struct Marks {
    /// Bytes that decide where others are.
    pub(crate) shape: Vec<Range<usize>>,
    /// First byte, kind and output of each number.
    pub(crate) numbers: Vec<(usize, Kind, usize)>,
}

/// The shape of the last message that was walked through.
#[derive(Debug, Clone, Default)]
pub(crate) struct Layout {
    length: usize,
    /// Bytes of the shape, one part behind the other, and where each part begins.
    known: Vec<u8>,
    parts: Vec<Range<usize>>,
    numbers: Vec<(usize, Kind, usize)>,
    big: bool,
    usable: bool,
    used: usize,
    walks: usize,
}

impl Layout {
    /// Whether a walk may pay off for later messages.
    pub(crate) fn worthwhile(&self) -> bool {
        self.walks < IN_VAIN + self.used
    }

    /// Keeps what a walk through `message` found.
    pub(crate) fn learn(&mut self, message: &[u8], big: bool, marks: Marks) {
        self.walks += 1;
        self.usable = false;
        let Marks { mut shape, numbers } = marks;
        // The head, which says the order of bytes.
        shape.push(0..message.len().min(4));
        shape.sort_by_key(|part| (part.start, std::cmp::Reverse(part.end)));
        shape.dedup_by(|part, before| part.end <= before.end);
        if shape.len() > MOST {
            return;
        }
        self.known.clear();
        shape.iter().for_each(|part| self.known.extend_from_slice(&message[part.clone()]));
        (self.length, self.parts, self.numbers, self.big, self.usable) = (message.len(), shape, numbers, big, true);
    }

    /// Takes the numbers of a message, if it has this shape; outputs that it does not carry are left as they are.
    pub(crate) fn take(&mut self, message: &[u8], outputs: &mut [f64]) -> bool {
        if !self.usable || message.len() != self.length {
            return false;
        }
        let mut known = self.known.as_slice();
        for part in &self.parts {
            let (own, rest) = known.split_at(part.len());
            if message[part.clone()] != *own {
                return false;
            }
            known = rest;
        }
        for &(at, kind, output) in &self.numbers {
            outputs[output] = number(kind, &message[at..at + kind.size().unwrap_or(0)], self.big);
        }
        self.used += 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bytes of shape at 4, a number behind them.
    fn learnt(message: &[u8]) -> Layout {
        let mut layout = Layout::default();
        layout.learn(message, false, Marks { shape: vec![4..6, 5..6], numbers: vec![(6, Kind::I16, 1)] });
        layout
    }

    #[test]
    fn a_message_of_the_same_shape_gives_its_numbers() {
        let mut layout = learnt(&[0, 1, 0, 0, 7, 8, 1, 0]);
        let mut outputs = [0.5; 2];
        assert!(layout.take(&[0, 1, 0, 0, 7, 8, 2, 1], &mut outputs));
        assert_eq!(outputs, [0.5, 258.0]);
    }

    #[test]
    fn another_shape_length_or_head_is_left_to_a_walk() {
        for other in [&[0, 1, 0, 0, 7, 9, 2, 1][..], &[0, 1, 0, 0, 7, 8, 2], &[0, 0, 0, 0, 7, 8, 2, 1], &[]] {
            assert!(!learnt(&[0, 1, 0, 0, 7, 8, 1, 0]).take(other, &mut [0.0; 2]), "{other:?}");
        }
    }

    #[test]
    fn shapes_that_change_from_message_to_message_are_no_longer_kept() {
        let mut layout = Layout::default();
        for i in 0..IN_VAIN {
            assert!(layout.worthwhile(), "{i}");
            let marks = Marks { shape: std::iter::once(4..5).collect(), numbers: Vec::new() };
            layout.learn(&[0, 1, 0, 0, i as u8], false, marks);
        }
        assert!(!layout.worthwhile());
        assert!(layout.take(&[0, 1, 0, 0, IN_VAIN as u8 - 1], &mut []) && layout.worthwhile());
    }
}
