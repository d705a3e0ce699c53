//! Days: an ISO date, a date with time, or a plain number.

use jiff::civil::{Date, DateTime};
use jiff::tz::TimeZone;
use jiff::{Timestamp, Unit};
use std::time::SystemTime;

/// The day that all dates are counted from; which one does not matter.
fn origin() -> DateTime {
    Date::constant(2000, 1, 1).to_datetime(jiff::civil::Time::midnight())
}

/// Days since 1 January 2000 of a date, or the number itself; none where the text is neither.
pub(crate) fn days(text: &str) -> Option<f64> {
    if let Ok(number) = text.parse::<f64>() {
        return Some(number).filter(|n| n.is_finite());
    }
    // A zone behind the time moves a day by less than a day and is left out.
    let local = text.trim_end_matches('Z');
    let moment = local.parse::<DateTime>().or_else(|_| local.parse::<Date>().map(|d| d.into())).ok()?;
    moment.since((Unit::Hour, origin())).ok()?.total(Unit::Hour).ok().map(|hours| hours / 24.0)
}

/// The date of a day, where the manifest wrote dates.
pub(crate) fn date(days: f64) -> Option<String> {
    let whole = days.floor();
    let span = jiff::Span::new().try_days(whole as i64).ok()?;
    Some(origin().date().checked_add(span).ok()?.to_string())
}

/// Whether a text is a date and not a number.
pub(crate) fn is_date(text: &str) -> bool {
    text.parse::<f64>().is_err() && days(text).is_some()
}

/// The first date in a file's name, with the time of day where one follows: `run_2026-01-31T14-05.csv` is 2026-01-31T14:05.
pub(crate) fn within(name: &str) -> Option<String> {
    let starts = name.char_indices().map(|(at, _)| at);
    let (at, day) = starts.filter_map(|at| Some((at, name.get(at..at + 10)?.parse::<Date>().ok()?))).next()?;
    let mut rest = name[at + 10..].chars();
    if !matches!(rest.next(), Some('T' | '_' | ' ')) {
        return Some(day.to_string());
    }
    let digits: String =
        rest.take_while(|c| c.is_ascii_digit() || matches!(c, '-' | ':' | '.')).filter(char::is_ascii_digit).collect();
    let pair = |k: usize| digits.get(k..k + 2).and_then(|two| two.parse::<i8>().ok());
    let time = pair(0).zip(pair(2)).and_then(|(hour, minute)| {
        jiff::civil::Time::new(hour, minute, pair(4).filter(|s| *s < 60).unwrap_or(0), 0).ok()
    });
    Some(time.map_or_else(|| day.to_string(), |time| day.to_datetime(time).to_string()))
}

/// A moment as the date and time in UTC, to the second.
pub(crate) fn of(time: SystemTime) -> Option<String> {
    let seconds = Timestamp::try_from(time).ok()?.as_second();
    let moment = Timestamp::from_second(seconds).ok()?.to_zoned(TimeZone::UTC);
    Some(moment.datetime().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_numbers_are_days_and_dates_read_back() {
        assert_eq!(days("2000-01-01"), Some(0.0));
        assert_eq!(days("2001-01-01"), Some(366.0));
        assert_eq!(days("2000-01-02T12:00:00"), Some(1.5));
        assert_eq!(days("2000-01-02T12:00:00Z"), Some(1.5));
        assert_eq!(days("17.5"), Some(17.5));
        assert_eq!(days("yesterday"), None);
        assert_eq!(days("nan"), None);
        assert_eq!(date(366.7).as_deref(), Some("2001-01-01"));
        assert!(is_date("2001-01-01") && !is_date("3"));
    }

    #[test]
    fn a_name_says_its_date_and_perhaps_the_time_of_day() {
        let of = |name| within(name).unwrap_or_default();
        assert_eq!(of("2026-01-31"), "2026-01-31");
        assert_eq!(of("run_2026-01-31T14-05-09"), "2026-01-31T14:05:09");
        assert_eq!(of("arm 2026-01-31_1405"), "2026-01-31T14:05:00");
        assert_eq!(of("2026-01-31_1"), "2026-01-31");
        assert_eq!(of("2026-01-31-after-repair"), "2026-01-31");
        assert_eq!(of("größe-2026-13-31"), "");
        assert_eq!(super::of(SystemTime::UNIX_EPOCH).as_deref(), Some("1970-01-01T00:00:00"));
    }
}
