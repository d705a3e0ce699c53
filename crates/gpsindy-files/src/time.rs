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
    /// Parts of a second since long ago, counted from this stamp, which is in those.
    Ticks(i128, Tick),
    /// Dates, counted from this one.
    Date(i128),
}

impl Clock {
    /// The clock that a first stamp shows; `None` where it is neither a number nor a date. Where a `unit` is given, the size says nothing.
    pub(crate) fn of(first: &str, unit: &str) -> Option<Self> {
        match first.parse::<f64>() {
            Ok(value) if value.abs() < EPOCH || !value.is_finite() => Some(Self::Plain),
            Ok(value) => {
                let tick = Tick::of(value, unit);
                let clock = |first| tick.map_or(Self::Epoch(first), |tick| Self::Ticks(first, tick));
                Some(decimal(first).map_or(Self::Plain, clock))
            }
            Err(_) => date(first).map(Self::Date),
        }
    }

    /// The stamp from which times are counted, s.
    pub(crate) fn origin(self) -> f64 {
        match self {
            Self::Plain => 0.0,
            Self::Epoch(first) | Self::Date(first) => seconds(first),
            Self::Ticks(first, tick) => seconds(first) / tick.per_second(),
        }
    }

    /// What the user should know of it; `first` is the first stamp as it is written.
    pub(crate) fn note(self, time: &Header, first: &str) -> Option<String> {
        match self {
            Self::Plain => None,
            Self::Epoch(_) | Self::Date(_) => Some(format!("times are counted from the first stamp, {first}")),
            Self::Ticks(_, tick) => Some(tick.note(time, first)),
        }
    }

    /// Seconds from the first stamp on; `None` where the text is no stamp of this clock.
    pub(crate) fn seconds(self, text: &str) -> Option<f64> {
        match self {
            Self::Plain => text.parse().ok(),
            Self::Epoch(first) => decimal(text).and_then(|parts| Some(seconds(parts.checked_sub(first)?))),
            Self::Ticks(first, tick) => {
                decimal(text).and_then(|parts| Some(seconds(parts.checked_sub(first)?) / tick.per_second()))
            }
            Self::Date(first) => date(text).and_then(|parts| Some(seconds(parts.checked_sub(first)?))),
        }
    }
}

/// A part of a second in which computers count the time since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tick {
    Milli,
    Micro,
    Nano,
}

impl Tick {
    /// The part that a stamp without a unit is counted in, by its size: each range reaches from 1973 to 5138, and none meets another.
    pub(crate) fn of(stamp: f64, unit: &str) -> Option<Self> {
        let size = stamp.abs();
        let ranges = [(1e11, Self::Milli), (1e14, Self::Micro), (1e17, Self::Nano)];
        ranges
            .into_iter()
            .find(|(from, _)| unit.is_empty() && (*from..1e3 * from).contains(&size))
            .map(|(_, tick)| tick)
    }

    pub(crate) fn per_second(self) -> f64 {
        match self {
            Self::Milli => 1e3,
            Self::Micro => 1e6,
            Self::Nano => 1e9,
        }
    }

    pub(crate) fn note(self, time: &Header, first: &str) -> String {
        let word = match self {
            Self::Milli => "milliseconds",
            Self::Micro => "microseconds",
            Self::Nano => "nanoseconds",
        };
        format!(
            "the stamps of `{}` are taken for {word} since 1970, which their size shows, and counted in seconds from the first, {first}",
            time.name
        )
    }
}

/// Steps of whole numbers from which they are hardly seconds: no motion is sampled once in a quarter of an hour.
const SLOWEST: f64 = 1e3;

/// Except where they are this many seconds or a multiple, as those of the weather, of tides and of power grids.
const HALF_HOUR: f64 = 1800.0;

/// What speaks against seconds where a time column has no unit: stamps that look counted in parts of a second.
pub(crate) fn doubt(time: &Header, times: &[f64]) -> Option<String> {
    if !time.unit.is_empty() || foreign_unit(time).is_some() || times.iter().any(|t| t.fract() != 0.0) {
        return None;
    }
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let step = *steps.get(steps.len() / 2)?;
    (step >= SLOWEST && step % HALF_HOUR != 0.0).then(|| {
        format!(
            "the stamps of `{}` are whole numbers, {step} from one to the next, and were taken for seconds; if they count milli-, micro- or nanoseconds, divide them by 1e3, 1e6 or 1e9",
            time.name
        )
    })
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
    // Apart, so that a whole number stays one.
    (parts / PARTS) as f64 + (parts % PARTS) as f64 / PARTS as f64
}

/// A number in parts of 1e-18; digits beyond the 18th behind the point are dropped, of one with an exponent those that a double drops.
fn decimal(text: &str) -> Option<i128> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let plain = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    if whole.len() + fraction.len() == 0 || whole.len() > 19 || !plain(whole) || !plain(fraction) {
        let value = text.parse::<f64>().ok().filter(|value| value.abs() < 1e20)?;
        return Some(value.trunc() as i128 * PARTS + (value.fract() * PARTS as f64) as i128);
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
        let clock = Clock::of("1396293887.844783943", "").unwrap();
        assert_eq!(clock.seconds("1396293887.844783943"), Some(0.0));
        assert_eq!(clock.seconds("1396293887.844783944"), Some(1e-9));
        assert_eq!(clock.seconds("1396293888"), Some(0.155_216_057));
        assert_eq!(clock.seconds("1396293886.844783943"), Some(-1.0));
        assert_eq!(clock.seconds("later"), None);
        assert_eq!(Clock::of("12.5", ""), Some(Clock::Plain));
    }

    #[test]
    fn parts_of_a_second_are_told_by_their_size() {
        for (first, second, step) in [
            ("1763000000123", "1763000000133", 0.01),
            ("1763000000123.5", "1763000000124", 0.0005),
            ("1763000000123456", "1763000000133456", 0.01),
            ("1763000000123456789", "1763000000123456790", 1e-9),
            ("1763000000123456789", "1763000000133456789", 0.01),
            ("1.763e18", "1.763001e18", 1000.0),
            ("1763000000", "1763000010", 10.0),
        ] {
            let clock = Clock::of(first, "").unwrap();
            assert_eq!(clock.seconds(second), Some(step), "{first}");
            assert!((clock.origin() - 1.763e9).abs() < 1.0, "{first}");
        }
        // A unit goes before the size.
        assert!(matches!(Clock::of("1763000000123", "ms"), Some(Clock::Epoch(_))));
        assert_eq!(Tick::of(1e22, ""), None);
    }

    #[test]
    fn whole_numbers_far_apart_are_doubted() {
        let time = Header::parse("t");
        let stamps = |step: f64| (0..20).map(|i| step * f64::from(i)).collect::<Vec<_>>();
        for step in [1e4, 1e7, 16_667.0] {
            let doubts = doubt(&time, &stamps(step)).unwrap();
            assert!(doubts.contains(&format!("whole numbers, {step} from one to the next")), "{doubts}");
        }
        // Seconds as they may be, and hours and days in seconds.
        for step in [1.0, 60.0, 600.0, 3_600.0, 86_400.0, 1000.5] {
            assert_eq!(doubt(&time, &stamps(step)), None, "{step}");
        }
        assert_eq!(doubt(&Header::parse("t [s]"), &stamps(1e4)), None);
    }

    #[test]
    fn dates_are_counted_from_the_first() {
        let clock = Clock::of("2024-02-28T23:59:59.500Z", "").unwrap();
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
            assert_eq!(Clock::of(text, ""), None, "{text}");
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
