//! The footer of a table, looked through before the `parquet` crate reads it.
//!
//! The crate (60.1) believes the count of a list in a field that it skips, and of a field that it knows it takes the kind for
//! granted: a broken byte makes it step through a billion elements that take no bytes, for seconds. Every element takes a byte at
//! least, and every field has its kind, so that such a footer is refused.
//!
//! Source: Apache Thrift, doc/specs/thrift-compact-protocol.md; Apache Parquet, src/main/thrift/parquet.thrift.

mod layout;

use crate::error::Result;
use crate::input::Input;
use layout::{FILE, Kind, Struct};
use std::io::{Read, Seek, SeekFrom};

/// Length of the footer and the mark behind it.
const END: usize = 8;

/// Levels of fields in fields; the crate itself goes no deeper.
const DEEPEST: usize = 64;

/// Whether the footer claims more elements than it has bytes, or a field of it is of another kind than the format says. What
/// else may be wrong in it is left to its reader.
///
/// # Errors
/// A file that can't be read.
pub(super) fn is_broken(input: &Input) -> Result<bool> {
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
    Ok(matches!(Walk(&bytes).fields(FILE, DEEPEST), Err(Why::Broken)))
}

/// Why a walk ends early.
enum Why {
    Broken,
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
        usize::try_from(number).ok().filter(|count| *count <= self.0.len()).ok_or(Why::Broken)
    }

    /// The fields of a struct up to its end.
    fn fields(&mut self, known: Struct, depth: usize) -> std::result::Result<(), Why> {
        let mut id = 0_i64;
        loop {
            let head = self.byte()?;
            // The crate ends a struct at every head of this kind.
            if head & 15 == 0 {
                return Ok(());
            }
            id = match head >> 4 {
                0 => {
                    let number = self.number()?;
                    (number >> 1) as i64 ^ -((number & 1) as i64)
                }
                more => id + i64::from(more),
            };
            let kind = known.iter().find(|(own, _)| i64::from(*own) == id).map(|(_, kind)| kind);
            if kind.is_some_and(|kind| !kind.is_written_as(head & 15)) {
                return Err(Why::Broken);
            }
            // A boolean has its value in its type.
            if !matches!(head & 15, 1 | 2) {
                self.value(head & 15, kind, depth)?;
            }
        }
    }

    /// `known`: what the format says of it, where it says anything.
    fn value(&mut self, kind: u8, known: Option<&Kind>, depth: usize) -> std::result::Result<(), Why> {
        let depth = depth.checked_sub(1).ok_or(Why::Other)?;
        match kind {
            // The crate takes no byte for a truth in a list, the protocol one; no footer has such a list.
            1 | 2 => Err(Why::Broken),
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
                let element = known.and_then(Kind::element);
                if number > 0 && element.is_some_and(|element| !element.is_written_as(head & 15)) {
                    return Err(Why::Broken);
                }
                for _ in 0..self.count(number)? {
                    self.value(head & 15, element, depth)?;
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
                    self.value(kinds >> 4, None, depth)?;
                    self.value(kinds & 15, None, depth)?;
                }
                Ok(())
            }
            12 => self.fields(known.map_or(&[], Kind::fields), depth),
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
        is_broken(&Input::of_bytes("a", &[b"PAR1", footer, &length, b"PAR1"].concat())).unwrap()
    }

    #[test]
    fn a_list_longer_than_the_footer_is_found_and_others_are_not() {
        // Field 15, which the format does not have: a list of 2^28 truths, of two bytes, of none.
        assert!(claims(&[0xf9, 0xf1, 0x80, 0x80, 0x80, 0x80, 0x01, 0]));
        assert!(!claims(&[0xf9, 0x23, 7, 8, 0]));
        assert!(!claims(&[0xf9, 0x03, 0]));
        // In a struct within a map within a list.
        assert!(claims(&[0xf9, 0x1b, 1, 0x3c, 5, 0x19, 0xf3, 0xff, 0xff, 0x7f, 0, 0]));
        // Truths in a list, on which the crate and the protocol disagree.
        assert!(claims(&[0xf9, 0x21, 1, 1, 0]));
        // Cut, of an unknown kind, too deep, empty.
        assert!(!claims(&[0xf9]) && !claims(&[0xfe, 0]) && !claims(&[0xfc; 200]) && !claims(&[]));
    }

    #[test]
    fn a_field_of_another_kind_is_found() {
        // The version as a number, as a list, as a struct.
        assert!(!claims(&[0x15, 2, 0]));
        assert!(claims(&[0x19, 0x15, 2, 0]));
        assert!(claims(&[0x1c, 0, 0]));
        // The schema: a list of structs whose name, field 4, is a text or a number; a list of numbers; an empty list.
        assert!(!claims(&[0x29, 0x1c, 0x48, 1, b'a', 0, 0]));
        assert!(claims(&[0x29, 0x1c, 0x45, 2, 0, 0]));
        assert!(claims(&[0x29, 0x15, 2, 0]));
        assert!(!claims(&[0x29, 0x00, 0]));
        // The version with its number written out.
        assert!(!claims(&[0x05, 2, 2, 0]) && claims(&[0x08, 2, 0, 0]));
    }
}
