//! Free numbers of terms and of given equations: named, and estimated with the coefficients.

use crate::error::{Error, Result};

/// Values that a free number is looked for at where the user names none. Convention: a quantity in a sensible unit is within two powers
/// of ten of 1.
const USUAL: (f64, f64) = (0.01, 100.0);

/// A number in a term or a given equation that is estimated, such as `h` in `x/(h + x)`.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeNumber {
    /// Its name.
    pub name: String,
    /// Values between which the search for it begins.
    pub start: (f64, f64),
    /// Values that it keeps between.
    pub bounds: (f64, f64),
}

/// No bounds.
const ANYWHERE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

impl FreeNumber {
    /// Reads `NAME` or `NAME=START`, which may end anywhere, or `NAME=LOW:HIGH`, which stays between.
    ///
    /// # Errors
    /// Text of another form.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong =
            || Error::settings(format!("`{text}`: expected NAME, NAME=START or NAME=LOW:HIGH, such as h=0.1:10"));
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(wrong);
        let (name, start, bounds) = match text.split_once('=') {
            None => (text, USUAL, ANYWHERE),
            Some((name, range)) => match range.split_once(':') {
                None => (name, (number(range)?, number(range)?), ANYWHERE),
                Some((low, high)) => {
                    let ends = (number(low)?, number(high)?);
                    (name, ends, ends)
                }
            },
        };
        let name = name.trim();
        let mut letters = name.chars();
        let is_name = letters.next().is_some_and(|c| c.is_ascii_alphabetic())
            && letters.all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_name || start.0 > start.1 {
            return Err(wrong());
        }
        Ok(Self { name: name.into(), start, bounds })
    }

    /// Whether no value and no range was named.
    pub(crate) fn is_unnamed(&self) -> bool {
        self.start == USUAL && self.bounds == ANYWHERE
    }

    /// Whether the search has more than one value to begin at.
    pub(crate) fn is_open(&self) -> bool {
        self.start.0 < self.start.1
    }

    /// The value at this share of the way: by ratios where both ends have one sign, by differences where not.
    pub(crate) fn at(&self, share: f64) -> f64 {
        let (low, high) = self.start;
        match low * high > 0.0 {
            true => low * (high / low).powf(share),
            false => low + share * (high - low),
        }
    }

    /// The same number at one value.
    pub(crate) fn fixed_at(&self, value: f64) -> Self {
        Self { start: (value, value), ..self.clone() }
    }

    /// The value in the middle.
    pub(crate) fn middle(&self) -> f64 {
        self.at(0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_the_command_line_writes_them() {
        assert_eq!(FreeNumber::parse("h").unwrap().start, USUAL);
        let fixed = FreeNumber { name: "h".into(), start: (0.5, 0.5), bounds: ANYWHERE };
        assert_eq!(FreeNumber::parse("h=0.5").unwrap(), fixed);
        assert_eq!(FreeNumber::parse("h = 1 : 4").unwrap().middle(), 2.0);
        let bounded = FreeNumber::parse("d=-1:3").unwrap();
        assert_eq!((bounded.middle(), bounded.bounds), (1.0, (-1.0, 3.0)));
        for text in ["", "2h", "h=", "h=a", "h=2:1", "h=nan", "x+y"] {
            assert!(FreeNumber::parse(text).is_err(), "{text}");
        }
    }
}
