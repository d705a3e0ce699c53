//! Numbers as the page and the terminal print them.

/// A number with three significant digits and no trailing zeros.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return (value + 0.0).to_string();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-3..6).contains(&exponent) {
        let text = format!("{value:.2e}");
        let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", without_zeros(mantissa));
    }
    fixed(value, (2 - exponent).max(0) as usize)
}

/// Both ends of a stretch, with enough digits to distinguish them.
pub(crate) fn span(from: f64, to: f64) -> (String, String) {
    let width = (to - from).abs();
    if !(width > 0.0 && width < 0.05 * from.abs().max(to.abs())) {
        return (number(from), number(to));
    }
    let decimals = (1 - width.log10().floor() as i32).max(0) as usize;
    (fixed(from, decimals), fixed(to, decimals))
}

/// A number with at most `decimals` decimals and no trailing zeros.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = without_zeros(&text);
    if text == "-0" { "0".into() } else { text.into() }
}

fn without_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// A number that may be absent; `absent` is printed then.
pub(crate) fn number_or(value: Option<f64>, absent: &str) -> String {
    value.map_or_else(|| absent.into(), number)
}

/// `0.31 m/s^2`, with a space that does not break.
pub(crate) fn with_unit(text: &str, unit: &str) -> String {
    if unit.is_empty() { text.into() } else { format!("{text}\u{a0}{unit}") }
}

/// A probability or a share in whole percent; never a false 0 or 100.
pub(crate) fn percent(share: f64) -> String {
    match share * 100.0 {
        p if p > 0.0 && p < 0.5 => "<\u{a0}1\u{a0}%".into(),
        p if p < 100.0 && p > 99.5 => ">\u{a0}99\u{a0}%".into(),
        p => format!("{p:.0}\u{a0}%"),
    }
}

/// The closed part of the gap: may be negative; a tenth of a percent near all of it.
pub(crate) fn percent_closed(closed: f64) -> String {
    let percent = closed * 100.0;
    if percent > 98.95 && percent < 99.95 {
        format!("{percent:.1}\u{a0}%")
    } else {
        format!("{}\u{a0}%", fixed(percent, 0))
    }
}

/// `p = 0.032`, `p = 1e-9`, `p < 1e-300`.
pub(crate) fn p_value(p: f64) -> String {
    if p <= 1e-300 {
        return "p\u{a0}<\u{a0}1e-300".into();
    }
    if p < 1e-3 {
        return format!("p\u{a0}=\u{a0}{p:.0e}");
    }
    let decimals = if p < 0.1 { 3 } else { 2 };
    format!("p\u{a0}=\u{a0}{}", fixed(p, decimals))
}

/// A fitted parameter with its deviation, in the digits that it supports.
pub(crate) fn with_deviation(value: f64, deviation: Option<f64>) -> String {
    let Some(deviation) = deviation.filter(|d| *d > 0.0 && d.is_finite()) else { return number(value) };
    let size = value.abs().max(deviation);
    if (1e-3..1e6).contains(&size) && deviation > 1e-6 * size {
        let decimals = (1 - deviation.log10().floor() as i32).clamp(0, 9) as usize;
        return format!("{} ± {}", fixed(value, decimals), fixed(deviation, decimals));
    }
    format!("{} ± {}", number(value), number(deviation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_short_stretch_differ() {
        let text = |from, to| {
            let (from, to) = span(from, to);
            format!("{from} {to}")
        };
        assert_eq!(text(23.912, 23.951), "23.912 23.951");
        assert_eq!(text(5.891, 7.068), "5.89 7.07");
        assert_eq!(text(-0.0714, -0.019), "-0.0714 -0.019");
        assert_eq!(text(2.0, 2.0), "2 2");
    }

    #[test]
    fn numbers_keep_three_digits_and_drop_zeros() {
        for (value, text) in [
            (0.0, "0"),
            (0.31, "0.31"),
            (-12.345, "-12.3"),
            (0.001234, "0.00123"),
            (12345.6, "12346"),
            (1e-9, "1e-9"),
            (2.5e8, "2.5e8"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn percentages_never_round_to_certainty() {
        assert_eq!(percent(0.001).replace("\u{a0}", " "), "< 1 %");
        assert_eq!(percent(0.999).replace("\u{a0}", " "), "> 99 %");
        assert_eq!(percent(0.0).replace("\u{a0}", " "), "0 %");
        assert_eq!(percent(1.0).replace("\u{a0}", " "), "100 %");
        assert_eq!(percent(0.951).replace("\u{a0}", " "), "95 %");
    }

    #[test]
    fn p_values_are_readable_at_every_size() {
        assert_eq!(p_value(0.0).replace("\u{a0}", " "), "p < 1e-300");
        assert_eq!(p_value(1e-9).replace("\u{a0}", " "), "p = 1e-9");
        assert_eq!(p_value(0.0321).replace("\u{a0}", " "), "p = 0.032");
        assert_eq!(p_value(0.43).replace("\u{a0}", " "), "p = 0.43");
    }
}
