//! The durations of a table: Parquet has no type for them, so that writers of Arrow (pandas, polars, pyarrow) keep whole numbers, and
//! what they count in Arrow's own schema among the file's metadata.
//!
//! Of that schema only the names of the columns and the units of durations are read; bytes that are not as they should be say nothing.
//!
//! Source: Apache Arrow, format/Message.fbs and format/Schema.fbs; FlatBuffers, "Internals".

/// The key of Arrow's schema among the metadata.
pub(super) const KEY: &str = "ARROW:schema";

/// The columns that are durations, each with the number of its ticks in a second.
pub(super) fn durations(encoded: &str) -> Vec<(String, f64)> {
    let message = decoded(encoded);
    fields(&message).unwrap_or_default()
}

/// Bytes written as base64, up to what is not.
fn decoded(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => Some(c - b'A'),
        b'a'..=b'z' => Some(c - b'a' + 26),
        b'0'..=b'9' => Some(c - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let (mut bytes, mut held, mut bits) = (Vec::with_capacity(text.len() / 4 * 3), 0_u32, 0);
    for sextet in text.bytes().map_while(value) {
        held = (held << 6 | u32::from(sextet)) & 0xffff;
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
        }
    }
    bytes
}

/// The durations among the fields of a message's schema.
fn fields(message: &[u8]) -> Option<Vec<(String, f64)>> {
    // The length of the message, behind a mark that old writers lack.
    let start = if message.starts_with(&[0xff; 4]) { 8 } else { 4 };
    let buffer = Buffer(message.get(start..)?);
    let root = buffer.follow(0)?;
    if buffer.byte(buffer.field(root, HEADER_TYPE)?)? != SCHEMA {
        return None;
    }
    let schema = buffer.follow(buffer.field(root, HEADER)?)?;
    let list = buffer.follow(buffer.field(schema, FIELDS)?)?;
    let mut found = Vec::new();
    // A list that claims more than there is ends with its first element that is not there.
    for k in 0..buffer.number(list)? as usize {
        let field = buffer.follow(list.checked_add(4 * (k + 1))?)?;
        let of_type = buffer.field(field, TYPE_TYPE).and_then(|at| buffer.byte(at));
        if of_type == Some(DURATION) {
            let kind = buffer.follow(buffer.field(field, TYPE)?)?;
            // A field that has its default value is not written.
            let unit = buffer.field(kind, UNIT).and_then(|at| buffer.byte(at)).unwrap_or(MILLISECOND);
            found.push((buffer.text(buffer.field(field, NAME)?)?, 1e3_f64.powi(i32::from(unit))));
        }
    }
    Some(found)
}

// Places of fields in their tables, and values of them, of Message.fbs and Schema.fbs.
const HEADER_TYPE: usize = 1;
const HEADER: usize = 2;
const SCHEMA: u8 = 1;
const FIELDS: usize = 1;
const NAME: usize = 0;
const TYPE_TYPE: usize = 2;
const TYPE: usize = 3;
const DURATION: u8 = 18;
const UNIT: usize = 0;
const MILLISECOND: u8 = 1;

/// A FlatBuffer: tables that point to each other.
struct Buffer<'a>(&'a [u8]);

impl Buffer<'_> {
    fn byte(&self, at: usize) -> Option<u8> {
        self.0.get(at).copied()
    }

    fn number(&self, at: usize) -> Option<u32> {
        let bytes = self.0.get(at..at.checked_add(4)?)?;
        bytes.try_into().ok().map(u32::from_le_bytes)
    }

    fn short(&self, at: usize) -> Option<usize> {
        let bytes = self.0.get(at..at.checked_add(2)?)?;
        bytes.try_into().ok().map(|bytes| usize::from(u16::from_le_bytes(bytes)))
    }

    /// Where an offset leads.
    fn follow(&self, at: usize) -> Option<usize> {
        at.checked_add(self.number(at)? as usize)
    }

    /// The place of a field of a table, where it is written.
    fn field(&self, table: usize, place: usize) -> Option<usize> {
        // The table's list of places lies before it by a signed number.
        let back = i64::from(self.number(table)?.cast_signed());
        let list = usize::try_from(i64::try_from(table).ok()? - back).ok()?;
        let entry = 4 + 2 * place;
        if entry + 2 > self.short(list)? {
            return None;
        }
        let offset = self.short(list.checked_add(entry)?)?;
        (offset > 0).then(|| table + offset)
    }

    fn text(&self, at: usize) -> Option<String> {
        let begin = self.follow(at)?;
        let length = self.number(begin)? as usize;
        let bytes = self.0.get(begin.checked_add(4)?..begin.checked_add(4)?.checked_add(length)?)?;
        String::from_utf8(bytes.to_vec()).ok()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// What pyarrow writes of a table with `t`, durations of milliseconds, and `x`, numbers.
    pub(crate) const MILLISECONDS: &str = concat!(
        "/////6AAAAAQAAAAAAAKAAwABgAFAAgACgAAAAABBAAMAAAACAAIAAAABAAIAAAABAAAAAIAAABEAAAABAAAANT///8AAAEDEAAAABgAAAAEAA",
        "AAAAAAAAEAAAB4AAYACAAGAAYAAAAAAAIAEAAUAAgABgAHAAwAAAAQABAAAAAAAAESEAAAABgAAAAEAAAAAAAAAAEAAAB0AAAABAAEAAQAAAAA",
        "AAAA",
    );

    /// What pyarrow writes of a table with `n`, whole numbers, and durations in `s`, `ms`, `us` and `ns`.
    const EVERY_UNIT: &str = concat!(
        "/////zABAAAQAAAAAAAKAAwABgAFAAgACgAAAAABBAAMAAAACAAIAAAABAAIAAAABAAAAAUAAADIAAAAiAAAAFwAAAAwAAAABAAAAFz///8AAA",
        "ESEAAAABQAAAAEAAAAAAAAAAIAAABucwAAiv///wAAAwCE////AAABEhAAAAAUAAAABAAAAAAAAAACAAAAdXMAALL///8AAAIArP///wAAARIQ",
        "AAAAGAAAAAQAAAAAAAAAAgAAAG1zAAAEAAQABAAAANT///8AAAESEAAAABgAAAAEAAAAAAAAAAEAAABzAAYACAAGAAYAAAAAAAAAEAAUAAgABg",
        "AHAAwAAAAQABAAAAAAAAECEAAAABwAAAAEAAAAAAAAAAEAAABuAAAACAAMAAgABwAIAAAAAAAAAUAAAAAAAAAA",
    );

    #[test]
    fn the_unit_of_every_duration_is_read() {
        assert_eq!(durations(MILLISECONDS), [("t".to_string(), 1e3)]);
        let named = |(name, ticks): (&str, f64)| (name.to_string(), ticks);
        assert_eq!(durations(EVERY_UNIT), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)].map(named));
    }

    #[test]
    fn bytes_that_are_no_schema_say_nothing_and_end_nothing() {
        assert_eq!(durations(""), []);
        let whole = decoded(EVERY_UNIT);
        for length in 0..whole.len() {
            let _ = fields(&whole[..length]);
        }
        for at in 0..whole.len() {
            for wrong in [0, 0x7f, 0xff] {
                let mut bytes = whole.clone();
                bytes[at] = wrong;
                let _ = fields(&bytes);
            }
        }
    }
}
