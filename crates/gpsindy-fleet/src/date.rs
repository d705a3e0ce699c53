//! Days: an ISO date, a date with time, or a plain number.

use jiff::Unit;
use jiff::civil::{Date, DateTime};

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
}
