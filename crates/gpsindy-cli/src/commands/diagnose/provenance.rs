//! What the page says of its making: the day, the version, the command line and the logs.

use gpsindy_core::Dataset;
use gpsindy_report::{LogFacts, Provenance};
use std::ffi::OsString;

/// The day, the version and the command line.
pub(super) fn provenance(line: &[OsString]) -> Provenance {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let days = since.map_or(0, |since| since.as_secs() / 86_400);
    let command: Vec<String> = line.iter().skip(1).map(|a| a.to_string_lossy().into_owned()).collect();
    Provenance {
        date: date(days),
        version: format!("gpsindy {}", env!("CARGO_PKG_VERSION")),
        command: format!("gpsindy {}", command.join(" ")),
        ..Provenance::default()
    }
}

/// The day that is `days` after 1970-01-01, year by year and month by month.
fn date(mut days: u64) -> String {
    let is_leap = |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let mut year = 1970;
    while days >= 365 + u64::from(is_leap(year)) {
        days -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(is_leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 1;
    for length in lengths {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    format!("{year}-{month:02}-{:02}", days + 1)
}

/// What every run of `data` holds.
pub(super) fn facts(data: &Dataset, held_out: bool) -> impl Iterator<Item = LogFacts> + '_ {
    data.runs().iter().map(move |run| LogFacts {
        name: run.name.clone(),
        held_out,
        samples: run.n_samples(),
        duration: run.time.last().zip(run.time.first()).map_or(0.0, |(last, first)| last - first),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_since_1970_are_dates() {
        let days = [(0, "1970-01-01"), (58, "1970-02-28"), (11_016, "2000-02-29"), (20_453, "2025-12-31")];
        for (days, expected) in days {
            assert_eq!(date(days), expected);
        }
    }
}
