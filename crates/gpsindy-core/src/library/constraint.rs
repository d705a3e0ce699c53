//! Prior knowledge of the equations: given equations, excluded or kept terms, signs of coefficients.

use super::Library;
use crate::error::{Error, Result};
use crate::expression::Expression;

/// An equation that is taken as given and not learnt, `x' = v`.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixed {
    /// The state.
    pub state: String,
    /// Its right side.
    pub equation: Expression,
}

impl Fixed {
    /// Reads `state' = expression`.
    ///
    /// # Errors
    /// Text without `' =`, or an expression that can't be read.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = || Error::settings(format!("`{text}`: expected an equation such as \"x' = v\""));
        let (left, right) = text.split_once('=').ok_or_else(wrong)?;
        let state = left.trim().strip_suffix('\'').ok_or_else(wrong)?.trim();
        if state.is_empty() {
            return Err(wrong());
        }
        Ok(Self { state: state.into(), equation: Expression::parse(right.trim())? })
    }
}

/// A term that the equation of a state must not hold, `STATE:TERM`; the state `*` means every state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Forbidden {
    /// The state, or `*`.
    pub state: String,
    /// The term as text.
    pub term: String,
}

impl Forbidden {
    /// Reads `STATE:TERM`.
    ///
    /// # Errors
    /// Text without a colon.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = || Error::settings(format!("`{text}`: expected STATE:TERM, such as v:x^2"));
        let (state, term) = text.split_once(':').ok_or_else(wrong)?;
        if state.trim().is_empty() || term.trim().is_empty() {
            return Err(wrong());
        }
        Ok(Self { state: state.trim().into(), term: term.trim().into() })
    }
}

/// A term that the equation of a state holds for certain, `STATE:TERM`, its coefficient to be learnt.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kept {
    /// The state.
    pub state: String,
    /// The term as text.
    pub term: String,
}

impl Kept {
    /// Reads `STATE:TERM`.
    ///
    /// # Errors
    /// Text without a colon.
    pub fn parse(text: &str) -> Result<Self> {
        let Forbidden { state, term } = Forbidden::parse(text)?;
        Ok(Self { state, term })
    }
}

/// The sign that a coefficient must have where its term is in, `STATE:TERM=+`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signed {
    /// The state.
    pub state: String,
    /// The term as text.
    pub term: String,
    /// Whether the coefficient is above 0.
    pub positive: bool,
}

impl Signed {
    /// Reads `STATE:TERM=+` or `STATE:TERM=-`.
    ///
    /// # Errors
    /// Text of another form.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = || Error::settings(format!("`{text}`: expected STATE:TERM=+ or STATE:TERM=-, such as v:v=-"));
        let (place, sign) = text.rsplit_once('=').ok_or_else(wrong)?;
        let positive = match sign.trim() {
            "+" => true,
            "-" => false,
            _ => return Err(wrong()),
        };
        let Forbidden { state, term } = Forbidden::parse(place).map_err(|_| wrong())?;
        Ok(Self { state, term, positive })
    }
}

/// Everything that is known beforehand.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Constraints {
    /// Equations taken as given.
    pub fixed: Vec<Fixed>,
    /// Terms that must stay out.
    pub forbidden: Vec<Forbidden>,
    /// Terms that are in whatever the logs say, their coefficients to be learnt.
    pub kept: Vec<Kept>,
    /// Signs that coefficients must have.
    pub signed: Vec<Signed>,
}

impl Constraints {
    /// The equation of `state` where it is given.
    pub fn fixed_equation(&self, state: &str) -> Option<&Expression> {
        self.fixed.iter().find(|f| f.state == state).map(|f| &f.equation)
    }

    /// Columns of `library` that the equation of `state` may hold.
    ///
    /// # Errors
    /// A term that the library lacks.
    pub fn allowed(&self, state: &str, library: &Library) -> Result<Vec<usize>> {
        let mut allowed = vec![true; library.n_terms()];
        for forbidden in self.forbidden.iter().filter(|f| f.state == state || f.state == "*") {
            allowed[library.index_of(&forbidden.term)?] = false;
        }
        Ok((0..library.n_terms()).filter(|&j| allowed[j]).collect())
    }

    /// Columns of `library` that the equation of `state` holds for certain.
    ///
    /// # Errors
    /// A term that the library lacks.
    pub fn kept(&self, state: &str, library: &Library) -> Result<Vec<usize>> {
        let mut kept = Vec::new();
        for term in self.kept.iter().filter(|k| k.state == state) {
            kept.push(library.index_of(&term.term)?);
        }
        kept.sort_unstable();
        kept.dedup();
        Ok(kept)
    }

    /// Sign of each coefficient of the equation of `state`, where one is demanded: `Some(true)` is above 0.
    ///
    /// # Errors
    /// A term that the library lacks.
    pub fn signs(&self, state: &str, library: &Library) -> Result<Vec<Option<bool>>> {
        let mut signs = vec![None; library.n_terms()];
        for signed in self.signed.iter().filter(|s| s.state == state) {
            signs[library.index_of(&signed.term)?] = Some(signed.positive);
        }
        Ok(signs)
    }

    /// Checks that every constraint speaks of one of `states` and of a term of `library`.
    ///
    /// # Errors
    /// An unknown state, term or name in a given equation, an equation given twice, a term that is kept and forbidden or kept in an equation that is given.
    pub fn check<S: AsRef<str>>(&self, states: &[S], library: &Library) -> Result<()> {
        let known = |name: &str| {
            if states.iter().any(|s| s.as_ref() == name) { Ok(()) } else { Err(Error::unknown("state", name, states)) }
        };
        for (i, fixed) in self.fixed.iter().enumerate() {
            known(&fixed.state)?;
            if self.fixed[..i].iter().any(|other| other.state == fixed.state) {
                return Err(Error::Duplicate { kind: "equation given for state".into(), name: fixed.state.clone() });
            }
            let names = library.known();
            if let Some(name) = fixed.equation.variables().iter().find(|name| !names.contains(name)) {
                let kind = format!("in the equation given for `{}` the name", fixed.state);
                return Err(Error::unknown(&kind, name, names));
            }
        }
        for forbidden in &self.forbidden {
            if forbidden.state != "*" {
                known(&forbidden.state)?;
            }
            library.index_of(&forbidden.term)?;
        }
        for signed in &self.signed {
            known(&signed.state)?;
            library.index_of(&signed.term)?;
        }
        for kept in &self.kept {
            known(&kept.state)?;
            let column = library.index_of(&kept.term)?;
            if self.fixed_equation(&kept.state).is_some() {
                let text = "is kept in an equation that is given; leave one of the two out";
                return Err(Error::settings(format!("term `{}` of state `{}` {text}", kept.term, kept.state)));
            }
            if !self.allowed(&kept.state, library)?.contains(&column) {
                let text = "is both kept and forbidden; leave one of the two out";
                return Err(Error::settings(format!("term `{}` of state `{}` {text}", kept.term, kept.state)));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::LibrarySettings;
    use super::*;

    #[test]
    fn constraints_read_as_the_command_line_writes_them() {
        assert_eq!(Fixed::parse("x' = v").unwrap(), Fixed { state: "x".into(), equation: Expression::variable("v") });
        assert_eq!(Forbidden::parse("v: x^2").unwrap(), Forbidden { state: "v".into(), term: "x^2".into() });
        assert_eq!(Signed::parse("v:v=-").unwrap(), Signed { state: "v".into(), term: "v".into(), positive: false });
        for text in ["x = v", "' = v", "x'", ""] {
            assert!(Fixed::parse(text).is_err(), "{text}");
        }
        assert_eq!(Kept::parse("v:u").unwrap(), Kept { state: "v".into(), term: "u".into() });
        assert!(Kept::parse("v").is_err());
        assert!(Forbidden::parse("v").is_err() && Signed::parse("v:v").is_err() && Signed::parse("v=+").is_err());
    }

    #[test]
    fn forbidden_terms_leave_the_allowed_ones() {
        let library =
            Library::new(&["x", "v"], &[], &LibrarySettings { degree: 1, ..LibrarySettings::default() }).unwrap();
        let constraints = Constraints {
            forbidden: vec![Forbidden::parse("x:x").unwrap(), Forbidden::parse("*:1").unwrap()],
            signed: vec![Signed::parse("v:v=-").unwrap()],
            ..Constraints::default()
        };
        assert_eq!(constraints.allowed("x", &library).unwrap(), [2]);
        assert_eq!(constraints.allowed("v", &library).unwrap(), [1, 2]);
        assert_eq!(constraints.signs("v", &library).unwrap(), [None, None, Some(false)]);
        constraints.check(&["x", "v"], &library).unwrap();
    }

    #[test]
    fn unknown_states_terms_and_doubled_equations_are_refused() {
        let library = Library::new(&["x"], &[], &LibrarySettings { degree: 1, ..LibrarySettings::default() }).unwrap();
        let check = |constraints: Constraints| constraints.check(&["x"], &library).unwrap_err().to_string();
        let fixed = |text: &str| Fixed::parse(text).unwrap();
        assert!(check(Constraints { fixed: vec![fixed("y' = x")], ..Constraints::default() }).contains("state `y`"));
        assert!(
            check(Constraints { fixed: vec![fixed("x' = x"), fixed("x' = 1")], ..Constraints::default() })
                .contains("twice")
        );
        let forbidden = vec![Forbidden::parse("x:x^2").unwrap()];
        assert!(check(Constraints { forbidden, ..Constraints::default() }).contains("term `x^2`"));
        let kept = vec![Kept::parse("x:x").unwrap()];
        let forbidden = vec![Forbidden::parse("*:x").unwrap()];
        let both = Constraints { kept: kept.clone(), forbidden, ..Constraints::default() };
        assert!(check(both).contains("both kept and forbidden"));
        let given = Constraints { kept, fixed: vec![fixed("x' = x")], ..Constraints::default() };
        assert!(check(given).contains("is given"));
    }
}
