//! Time stamps: which column holds them, and exact differences of large ones.
//!
//! Seconds since 1970 have 24 digits before and behind the point in some logs; a double has 16. So a log whose first stamp
//! lies beyond [`EPOCH`] is counted from that stamp, and the difference is taken before it is rounded.

use crate::header::Header;

/// Stamps beyond this many seconds (three years) are a calendar's, not a stopwatch's.
pub(crate) const EPOCH: f64 = 1e8;

/// Parts of a second in which stamps are held exactly: 1e-18 s.
const PARTS: i128 = 1_000_000_000_000_000_000;

/// How the times of a table are read, by its first one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Clock {
    /// Seconds as they are.
    Plain,
    /// Seconds since long ago, counted from this stamp.
    Epoch(i128),
    /// Dates, counted from this one.
    Date(i128),
}

impl Clock {
    /// The clock that a first stamp shows; `None` where it is neither a number nor a date.
    pub(crate) fn of(first: &str) -> Option<Self> {
        match first.parse::<f64>() {
            Ok(value) if value.abs() < EPOCH || !value.is_finite() => Some(Self::Plain),
            Ok(_) => Some(decimal(first).map_or(Self::Plain, Self::Epoch)),
            Err(_) => date(first).map(Self::Date),
        }
    }

    /// The stamp from which times are counted, s.
    pub(crate) fn origin(self) -> f64 {
        match self {
            Self::Plain => 0.0,
            Self::Epoch(first) | Self::Date(first) => seconds(first),
        }
    }

    /// Seconds from the first stamp on; `None` where the text is no stamp of this clock.
    pub(crate) fn seconds(self, text: &str) -> Option<f64> {
        match self {
            Self::Plain => text.parse().ok(),
            Self::Epoch(first) => decimal(text).and_then(|parts| Some(seconds(parts.checked_sub(first)?))),
            Self::Date(first) => date(text).and_then(|parts| Some(seconds(parts.checked_sub(first)?))),
        }
    }
}

/// The time column where no option names one: `t`, else `time`, else `time` in any case, else `__time`.
pub(crate) fn column(headers: &[Header]) -> Option<usize> {
    let named = |wanted: &dyn Fn(&str) -> bool| headers.iter().position(|h| wanted(&h.name));
    named(&|name| name == "t")
        .or_else(|| named(&|name| name == "time"))
        .or_else(|| named(&|name| name.eq_ignore_ascii_case("time")))
        .or_else(|| named(&|name| name == "__time"))
}

/// The unit of a time column where it is another one than the second: in brackets, or as the column's own name.
pub(crate) fn foreign_unit(header: &Header) -> Option<&str> {
    const SHORT: [&str; 10] = ["ns", "us", "\u{b5}s", "\u{3bc}s", "ms", "min", "h", "hr", "d", "yr"];
    const WORDS: [&str; 6] = ["minute", "hour", "day", "week", "month", "year"];
    let is_word = |text: &str| {
        let text = text.to_lowercase();
        WORDS.contains(&text.strip_suffix('s').unwrap_or(&text))
    };
    match header.unit.as_str() {
        "" => Some(header.name.as_str()).filter(|name| is_word(name)),
        unit => Some(unit).filter(|unit| SHORT.contains(unit) || is_word(unit)),
    }
}

fn seconds(parts: i128) -> f64 {
    parts as f64 / PARTS as f64
}

/// A plain decimal number in parts of a second; digits beyond the 18th are dropped.
fn decimal(text: &str) -> Option<i128> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let plain = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    if whole.len() + fraction.len() == 0 || whole.len() > 18 || !plain(whole) || !plain(fraction) {
        return None;
    }
    let whole: i128 = if whole.is_empty() { 0 } else { whole.parse().ok()? };
    Some(sign * (whole * PARTS + fractions(fraction)?))
}

fn fractions(digits: &str) -> Option<i128> {
    let kept = &digits[..digits.len().min(18)];
    let value: i128 = if kept.is_empty() { 0 } else { kept.parse().ok()? };
    Some(value * 10_i128.pow(18 - kept.len() as u32))
}

/// A date after ISO 8601, `2024-05-01T12:00:00.25+02:00`: parts of a second since 1970; without a zone it is UTC.
fn date(text: &str) -> Option<i128> {
    if !text.is_ascii() || text.len() < 16 {
        return None;
    }
    let number = |from: usize, to: usize| -> Option<i64> {
        let part = text.get(from..to)?;
        if part.bytes().all(|b| b.is_ascii_digit()) { part.parse().ok() } else { None }
    };
    let mark = |at: usize, any: &[u8]| text.as_bytes().get(at).is_some_and(|b| any.contains(b));
    if !(mark(4, b"-/") && mark(7, b"-/") && mark(10, b"T t") && mark(13, b":")) {
        return None;
    }
    let (year, month, day) = (number(0, 4)?, number(5, 7)?, number(8, 10)?);
    let (hour, minute) = (number(11, 13)?, number(14, 16)?);
    if !((1..=12).contains(&month) && (1..=31).contains(&day) && hour < 25 && minute < 60) {
        return None;
    }
    let mut rest = &text[16..];
    let (mut second, mut fraction) = (0, 0);
    if let Some(behind) = rest.strip_prefix(':') {
        second = number(17, 19)?;
        rest = &behind[2..];
        if let Some(behind) = rest.strip_prefix(['.', ',']) {
            let end = behind.bytes().position(|b| !b.is_ascii_digit()).unwrap_or(behind.len());
            fraction = fractions(&behind[..end])?;
            rest = &behind[end..];
        }
    }
    let total = days(year, month, day) * 86_400 + hour * 3_600 + minute * 60 + second - zone(rest.trim())?;
    Some(i128::from(total) * PARTS + fraction)
}

/// Seconds east of Greenwich: `Z`, `+02:00`, `-0500`, `+01`.
fn zone(text: &str) -> Option<i64> {
    if matches!(text, "" | "Z" | "z" | "UTC") {
        return Some(0);
    }
    let sign = match text.as_bytes()[0] {
        b'+' => 1,
        b'-' => -1,
        _ => return None,
    };
    let digits: String = text[1..].chars().filter(|c| *c != ':').collect();
    if !matches!(digits.len(), 2 | 4) || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let hours: i64 = digits[..2].parse().ok()?;
    let minutes: i64 = if digits.len() == 4 { digits[2..].parse().ok()? } else { 0 };
    Some(sign * (hours * 3_600 + minutes * 60))
}

/// Days from 1970-01-01 to a date of the Gregorian calendar.
fn days(year: i64, month: i64, day: i64) -> i64 {
    // Years begin in March, so that the leap day is the last one.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let century = year.div_euclid(100);
    365 * year + year.div_euclid(4) - century + century.div_euclid(4) + (153 * month + 2) / 5 + day - 1 - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epoch_seconds_keep_every_digit() {
        let clock = Clock::of("1396293887.844783943").unwrap();
        assert_eq!(clock.seconds("1396293887.844783943"), Some(0.0));
        assert_eq!(clock.seconds("1396293887.844783944"), Some(1e-9));
        assert_eq!(clock.seconds("1396293888"), Some(0.155_216_057));
        assert_eq!(clock.seconds("1396293886.844783943"), Some(-1.0));
        assert_eq!(clock.seconds("later"), None);
        assert_eq!(Clock::of("12.5"), Some(Clock::Plain));
    }

    #[test]
    fn dates_are_counted_from_the_first() {
        let clock = Clock::of("2024-02-28T23:59:59.500Z").unwrap();
        for (text, seconds) in [
            ("2024-02-28 23:59:59.500000001", 1e-9),
            ("2024-02-29T00:00:00Z", 0.5),
            ("2024-03-01T00:00:00", 86_400.5),
            ("2024-02-29T02:00:00+02:00", 0.5),
            ("2024-02-28T19:00:00-0500", 0.5),
            ("2025-02-28T23:59:59,5", 366.0 * 86_400.0),
        ] {
            assert_eq!(clock.seconds(text), Some(seconds), "{text}");
        }
        assert_eq!(date("1970-01-01T00:00:00Z"), Some(0));
        assert_eq!(date("2000-03-01T00:00Z"), Some(951_868_800 * PARTS));
        for text in
            ["2024-13-01T00:00:00", "yesterday at noon", "2024-02-28", "2024-02-28T23:59:5", "2024-02-28T23:59:59 CET"]
        {
            assert_eq!(Clock::of(text), None, "{text}");
        }
    }

    #[test]
    fn the_time_column_is_found_by_its_usual_names() {
        let find = |names: &[&str]| column(&names.iter().map(|n| Header::parse(n)).collect::<Vec<_>>());
        assert_eq!(find(&["time", "t"]), Some(1));
        assert_eq!(find(&["T", "Time [s]"]), Some(1));
        assert_eq!(find(&["__time", "x"]), Some(0));
        assert_eq!(find(&["T", "x"]), None);
    }
}
