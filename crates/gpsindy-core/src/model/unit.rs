//! Units as text: their products and powers, as far as the text can be read.

use std::f64::consts::TAU;

/// The product of `(unit, power)` pairs in the shortest form: `m/s^2` by `m/s` squared gives `1/m`.
///
/// Empty where a unit is empty (unknown), where one can't be read without doubt (`W/m K`), and where all units cancel.
/// Nothing is converted: `mm` and `m` are two units, and `rad` is one too.
pub(crate) fn product(parts: &[(&str, i32)]) -> String {
    let mut powers: Vec<(String, i32)> = Vec::new();
    for (unit, power) in parts {
        let Some(factors) = factors(unit) else { return String::new() };
        for (symbol, own) in factors {
            match powers.iter_mut().find(|(known, _)| *known == symbol) {
                Some((_, sum)) => *sum += own * power,
                None => powers.push((symbol, own * power)),
            }
        }
    }
    let side = |sign: i32| -> Vec<String> {
        let own = powers.iter().filter(|(_, power)| power * sign > 0);
        own.map(|(symbol, power)| match power * sign {
            1 => symbol.clone(),
            power => format!("{symbol}^{power}"),
        })
        .collect()
    };
    let (above, below) = (side(1).join("*"), side(-1));
    match (above.as_str(), below.as_slice()) {
        (_, []) => above,
        ("", [one]) => format!("1/{one}"),
        ("", all) => format!("1/({})", all.join("*")),
        (_, [one]) => format!("{above}/{one}"),
        (_, all) => format!("{above}/({})", all.join("*")),
    }
}

/// The symbols of a unit with their powers; `None` where it is empty or has two readings.
fn factors(unit: &str) -> Option<Vec<(String, i32)>> {
    let mut pieces = unit.split('/');
    let mut found = several(pieces.next()?)?;
    for piece in pieces {
        let piece = piece.trim();
        let inside = piece.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
        let below = several(inside.unwrap_or(piece))?;
        // Whether the second factor of `W/m K` is divided by is anyone's guess.
        if inside.is_none() && below.len() > 1 {
            return None;
        }
        found.extend(below.into_iter().map(|(symbol, power)| (symbol, -power)));
    }
    Some(found)
}

/// Factors in a row, separated by `*`, a dot or a space.
fn several(text: &str) -> Option<Vec<(String, i32)>> {
    let words: Vec<&str> = text.split(['*', '\u{b7}', '\u{22c5}', ' ']).filter(|word| !word.is_empty()).collect();
    if words.is_empty() {
        return None;
    }
    let found: Option<Vec<Option<(String, i32)>>> = words.into_iter().map(factor).collect();
    Some(found?.into_iter().flatten().collect())
}

/// A symbol and its power; `Some(None)` for the number one, `None` for what is no symbol.
fn factor(word: &str) -> Option<Option<(String, i32)>> {
    if word == "1" {
        return Some(None);
    }
    let (symbol, power) = match word.split_once('^') {
        Some((symbol, power)) => (symbol, power.parse().ok()?),
        None => match (word.strip_suffix('\u{b2}'), word.strip_suffix('\u{b3}')) {
            (Some(symbol), _) => (symbol, 2),
            (_, Some(symbol)) => (symbol, 3),
            _ => (word, 1),
        },
    };
    (!symbol.is_empty() && symbol.chars().all(is_letter) && (-9..=9).contains(&power))
        .then(|| Some((symbol.to_string(), power)))
}

/// A full turn in a unit of angle; `None` for other units.
pub(crate) fn turn(unit: &str) -> Option<f64> {
    match unit {
        "rad" => Some(TAU),
        "deg" | "°" => Some(360.0),
        _ => None,
    }
}

/// By how much a place in one unit moves in a second at a rate of one in another: 6 for `deg` and `rpm`; `None` where the two do not belong
/// together, or one is unknown.
pub(crate) fn per_second(place: &str, rate: &str) -> Option<f64> {
    let (of, per) = if rate == "rpm" { ("rev", "min") } else { rate.split_once('/')? };
    let seconds = match per {
        "s" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        _ => return None,
    };
    let ((kind, size), (other, of_rate)) = (size_of_place(place)?, size_of_place(of)?);
    (kind == other).then(|| of_rate / (seconds * size))
}

/// Whether a unit is one of an angle or a length.
pub(crate) fn is_place(unit: &str) -> bool {
    size_of_place(unit).is_some()
}

/// Whether a unit is one of a length.
pub(crate) fn is_length(unit: &str) -> bool {
    matches!(size_of_place(unit), Some((Place::Length, _)))
}

/// What a unit of a place measures.
#[derive(PartialEq)]
enum Place {
    Angle,
    Length,
}

/// The unit of a place in radians or metres; `None` for other units.
fn size_of_place(unit: &str) -> Option<(Place, f64)> {
    let angle = |size: f64| Some((Place::Angle, size));
    let length = |size: f64| Some((Place::Length, size));
    match unit {
        "rev" | "turn" => angle(TAU),
        "m" => length(1.0),
        "km" => length(1e3),
        "cm" => length(1e-2),
        "mm" => length(1e-3),
        "um" => length(1e-6),
        "in" => length(0.0254),
        "ft" => length(0.3048),
        _ => angle(TAU / turn(unit)?),
    }
}

/// A unit in which the second means another unit of time: `kpelts/s` counted in `year` gives `kpelts/year`.
pub(crate) fn in_time_unit(unit: &str, time_unit: &str) -> String {
    let mut found = String::with_capacity(unit.len());
    for piece in unit.split_inclusive(|c: char| !is_letter(c)) {
        let symbol = piece.trim_end_matches(|c: char| !is_letter(c));
        found.push_str(if symbol == "s" { time_unit } else { symbol });
        found.push_str(&piece[symbol.len()..]);
    }
    found
}

/// Whether a unit speaks of seconds.
pub(crate) fn has_seconds(unit: &str) -> bool {
    unit.split(|c: char| !is_letter(c)).any(|symbol| symbol == "s")
}

fn is_letter(c: char) -> bool {
    c.is_alphabetic() || matches!(c, '\u{b0}' | '%' | '_')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_add_up_and_what_cancels_is_gone() {
        for (parts, wanted) in [
            (&[("m/s^2", 1), ("m/s", -1)][..], "1/s"),
            (&[("m/s^2", 1), ("m/s", -2)], "1/m"),
            (&[("rad/s^2", 1), ("rad", -1)], "1/s^2"),
            (&[("N*m", 1), ("rad/s", -1)], "N*m*s/rad"),
            (&[("N/(m s)", 1), ("m\u{b2}", -1)], "N/(m^3*s)"),
            (&[("kg\u{b7}m^2/s", 1), ("1/s", -1)], "kg*m^2"),
            (&[("\u{b0}C/s", 1), ("\u{b0}C", -1), ("s", -1)], "1/s^2"),
            (&[("m", 1), ("m", -1)], ""),
            (&[("V", -1), ("A", -1)], "1/(V*A)"),
        ] {
            assert_eq!(product(parts), wanted, "{parts:?}");
        }
    }

    #[test]
    fn a_place_moves_by_as_much_as_its_rate_says_in_a_second() {
        for (place, rate, wanted) in [
            ("deg", "rpm", Some(6.0)),
            ("rad", "rpm", Some(TAU / 60.0)),
            ("deg", "rad/s", Some(360.0 / TAU)),
            ("mm", "m/s", Some(1e3)),
            ("m", "km/h", Some(1.0 / 3.6)),
            ("m", "rad/s", None),
            ("mol", "mol/s", None),
            ("rad", "", None),
        ] {
            match (per_second(place, rate), wanted) {
                (Some(found), Some(wanted)) => assert!((found / wanted - 1.0).abs() < 1e-12, "{place} {rate} {found}"),
                (found, wanted) => assert_eq!(found, wanted, "{place} {rate}"),
            }
        }
    }

    #[test]
    fn a_second_becomes_the_log_s_unit_of_time_and_nothing_else_does() {
        for (unit, wanted) in [
            ("kpelts/s", "kpelts/year"),
            ("1/(kpelts*s)", "1/(kpelts*year)"),
            ("kg*s^2", "kg*year^2"),
            ("ms", "ms"),
            ("m_s/s", "m_s/year"),
            ("", ""),
        ] {
            assert_eq!(in_time_unit(unit, "year"), wanted);
            assert_eq!(has_seconds(unit), unit != wanted, "{unit}");
        }
    }

    #[test]
    fn what_is_unknown_or_has_two_readings_gives_no_unit() {
        for unit in ["", "W/m K", "m/", "2 m", "m^x", "m s-1", "(m", "m^99"] {
            assert_eq!(product(&[("m/s", 1), (unit, -1)]), "", "{unit}");
        }
    }
}
