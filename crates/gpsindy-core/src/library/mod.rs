//! Candidate terms of the equations: their names and their values, from one list.
//!
//! Theta(X, U) of the paper, section II: constant, polynomials, sine and cosine of every state and control, their
//! products, and whatever expression the user adds.

mod constraint;
mod number;
mod term;

pub use constraint::{Constraints, Fixed, Forbidden, Kept, Signed};
pub use number::FreeNumber;
pub use term::Term;

use crate::error::{Error, Result};
use crate::expression::{Expression, Function, Operator, Tape};
use faer::{Mat, MatRef};

/// Which terms a library holds.
///
/// | setting | default | range | purpose |
/// | --- | --- | --- | --- |
/// | `degree` | 3 | 0..=9 | highest degree of the polynomials |
/// | `trig` | false | | sine and cosine of every variable |
/// | `products` | false | | polynomials of degree 1 and 2 (not above `degree`) times sine and cosine; implies `trig` |
/// | `extra` | none | | further terms as text |
/// | `controls` | true | | whether controls are variables of the polynomials and of sine and cosine |
/// | `numbers` | none | | numbers in `extra` and in given equations that are estimated |
#[derive(Debug, Clone, PartialEq)]
pub struct LibrarySettings {
    /// Highest degree of the polynomials.
    pub degree: usize,
    /// Sine and cosine of every variable.
    pub trig: bool,
    /// Polynomials of low degree times sine and cosine.
    pub products: bool,
    /// Further terms as text; each counts as one term.
    pub extra: Vec<String>,
    /// Whether controls take part, besides the states. Terms in `extra` may always use them.
    pub controls: bool,
    /// Numbers in `extra` and in given equations that are estimated.
    pub numbers: Vec<FreeNumber>,
}

impl Default for LibrarySettings {
    fn default() -> Self {
        Self { degree: 3, trig: false, products: false, extra: Vec::new(), controls: true, numbers: Vec::new() }
    }
}

/// A library larger than this is a slip of a setting, not a wish.
const MOST_TERMS: usize = 5000;

/// Candidate terms over named variables.
///
/// ```
/// use gpsindy_core::library::{Library, LibrarySettings};
/// let settings = LibrarySettings { degree: 2, ..LibrarySettings::default() };
/// let library = Library::new(&["x1", "x2"], &[], &settings)?;
/// assert_eq!(library.names(), ["1", "x1", "x2", "x1^2", "x1*x2", "x2^2"]);
/// # Ok::<(), gpsindy_core::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Library {
    variables: Vec<String>,
    /// Free numbers and their values.
    numbers: Vec<(String, f64)>,
    terms: Vec<Term>,
    /// The terms with values for numbers.
    tape: Tape,
}

impl Library {
    /// The library of `settings` over states and controls.
    ///
    /// Order: constant, degree 1, degree 2, ..., sines, cosines, products with sines, products with cosines, extra terms.
    ///
    /// # Errors
    /// A setting out of range, an extra term that can't be read or names something unknown.
    pub fn new<S: AsRef<str>>(states: &[S], controls: &[S], settings: &LibrarySettings) -> Result<Self> {
        if settings.degree > 9 {
            return Err(Error::range("degree", "from 0 to 9", settings.degree));
        }
        let variables: Vec<String> = states.iter().chain(controls).map(|s| s.as_ref().to_string()).collect();
        let used = if settings.controls { variables.len() } else { states.len() };
        let monomials: Vec<Vec<usize>> = (0..=settings.degree).flat_map(|d| multisets(used, d)).collect();
        let mut terms: Vec<Term> = monomials.iter().map(|m| Term::product(&variables, m, None)).collect();
        for function in [Function::Sin, Function::Cos] {
            if settings.trig || settings.products {
                terms.extend((0..used).map(|j| Term::product(&variables, &[], Some((function, j)))));
            }
        }
        for degree in 1..=settings.degree.min(2) {
            for function in [Function::Sin, Function::Cos] {
                if settings.products {
                    let factors = monomials.iter().filter(|m| m.len() == degree);
                    let pairs = factors.flat_map(|m| (0..used).map(move |j| (m, j)));
                    terms.extend(pairs.map(|(m, j)| Term::product(&variables, m, Some((function, j)))));
                }
            }
        }
        let numbers: Vec<(String, f64)> = settings.numbers.iter().map(|n| (n.name.clone(), n.middle())).collect();
        let names = with_numbers(&variables, &numbers);
        if let Some((i, name)) = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name)) {
            let kind = if i < variables.len() { "variable" } else { "free number" };
            return Err(Error::Duplicate { kind: kind.into(), name: name.clone() });
        }
        for text in &settings.extra {
            terms.push(Term::parse(text, &names)?);
        }
        Self::of_terms_with(variables, numbers, terms)
    }

    /// A library of the given terms, each kept once.
    ///
    /// # Errors
    /// No term, more than 5000, a term of unknown names, or a term with a memory (`delay`, `play`).
    pub fn of_terms(variables: Vec<String>, terms: Vec<Term>) -> Result<Self> {
        Self::of_terms_with(variables, Vec::new(), terms)
    }

    fn of_terms_with(variables: Vec<String>, numbers: Vec<(String, f64)>, terms: Vec<Term>) -> Result<Self> {
        let mut kept: Vec<Term> = Vec::with_capacity(terms.len());
        let mut seen = std::collections::HashSet::new();
        for term in terms {
            if seen.insert(term.name().to_string()) {
                kept.push(term);
            }
        }
        if kept.is_empty() {
            return Err(Error::settings("the library holds no term; raise `degree` or add a term"));
        }
        if kept.len() > MOST_TERMS {
            let expected = format!("small enough for {MOST_TERMS} terms");
            return Err(Error::range("degree", &expected, format!("a library of {} terms", kept.len())));
        }
        let tape = tape_of(&kept, &variables, &numbers)?;
        Ok(Self { variables, numbers, terms: kept, tape })
    }

    /// Free numbers of the terms and of given equations, with their values.
    pub fn numbers(&self) -> &[(String, f64)] {
        &self.numbers
    }

    /// The same terms at other values of the free numbers, in their order.
    ///
    /// # Errors
    /// As many values as numbers are needed.
    pub(crate) fn at(&self, values: &[f64]) -> Result<Self> {
        let numbers: Vec<(String, f64)> =
            self.numbers.iter().map(|(n, _)| n.clone()).zip(values.iter().copied()).collect();
        let tape = tape_of(&self.terms, &self.variables, &numbers)?;
        Ok(Self { numbers, tape, ..self.clone() })
    }

    /// The names that an expression over this library may use: variables, then free numbers.
    pub(crate) fn known(&self) -> Vec<String> {
        with_numbers(&self.variables, &self.numbers)
    }

    /// The variables, states before controls: the columns that [`Library::evaluate`] reads.
    pub fn variables(&self) -> &[String] {
        &self.variables
    }

    /// The terms, in the order of the columns.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Number of terms p.
    pub fn n_terms(&self) -> usize {
        self.terms.len()
    }

    /// Names of the terms, in the order of the columns.
    pub fn names(&self) -> Vec<&str> {
        self.terms.iter().map(Term::name).collect()
    }

    /// Column of the term written as `text`; factors may be in any order.
    ///
    /// # Errors
    /// Text that can't be read, or a term that the library lacks.
    pub fn index_of(&self, text: &str) -> Result<usize> {
        let term = Term::parse(text, &self.known())?;
        self.terms
            .iter()
            .position(|t| t.name() == term.name())
            .ok_or_else(|| Error::unknown("term", text, self.names()))
    }

    /// Theta: every term at every sample.
    ///
    /// # Shapes
    /// `values`: (r x number of variables), states before controls. `time`: r, s. Returns (r x p).
    ///
    /// # Errors
    /// Sizes that differ, or a term that has no finite value at a sample.
    pub fn evaluate(&self, values: MatRef<'_, f64>, time: &[f64]) -> Result<Mat<f64>> {
        let theta = self.values(values, time)?;
        for (i, t) in time.iter().enumerate() {
            if let Some(j) = (0..self.terms.len()).find(|&j| !theta[(i, j)].is_finite()) {
                return Err(Error::NotFinite { what: format!("term `{}` at t = {t} s", self.terms[j].name()) });
            }
        }
        Ok(theta)
    }

    /// As [`Library::evaluate`], finite or not.
    pub(crate) fn values(&self, values: MatRef<'_, f64>, time: &[f64]) -> Result<Mat<f64>> {
        const LANES: usize = 8;
        let (r, v) = (values.nrows(), self.variables.len());
        if values.ncols() != v || time.len() != r {
            let found = format!("{r} x {} and {} times", values.ncols(), time.len());
            return Err(Error::shape("values of the library's variables", format!("{r} x {v} and {r} times"), found));
        }
        let mut theta = Mat::zeros(r, self.terms.len());
        let mut registers = self.tape.registers::<LANES>();
        for first in (0..r).step_by(LANES) {
            // Lanes beyond the last sample repeat it.
            let row = |lane: usize| (first + lane).min(r - 1);
            for j in 0..v {
                registers[j] = std::array::from_fn(|lane| values[(row(lane), j)]);
            }
            registers[v] = std::array::from_fn(|lane| time[row(lane)]);
            self.tape.evaluate(&mut registers);
            for j in 0..self.terms.len() {
                let results = self.tape.output(&registers, j);
                for (lane, &value) in results.iter().enumerate().take(r - first) {
                    theta[(first + lane, j)] = value;
                }
            }
        }
        Ok(theta)
    }

    /// The right side that `coefficients` (p) make; terms with coefficient 0 are left out.
    pub fn equation(&self, coefficients: &[f64]) -> Expression {
        let mut sum = Expression::Number(0.0);
        for (term, &value) in self.terms.iter().zip(coefficients) {
            if value != 0.0 {
                let part = scaled(value.abs(), term.expression());
                sum = if value < 0.0 { sum.minus(part) } else { sum.plus(part) };
            }
        }
        sum
    }
}

fn with_numbers(variables: &[String], numbers: &[(String, f64)]) -> Vec<String> {
    variables.iter().cloned().chain(numbers.iter().map(|(name, _)| name.clone())).collect()
}

fn valued(expression: &Expression, numbers: &[(String, f64)]) -> Expression {
    numbers.iter().fold(expression.clone(), |all, (name, value)| all.substitute(name, &Expression::Number(*value)))
}

fn tape_of(terms: &[Term], variables: &[String], numbers: &[(String, f64)]) -> Result<Tape> {
    let expressions: Vec<Expression> = terms.iter().map(|term| valued(term.expression(), numbers)).collect();
    Tape::new(&expressions, variables)
}

/// `value * expression`, the number as the first factor, so that it prints without parentheses.
fn scaled(value: f64, expression: &Expression) -> Expression {
    match expression {
        Expression::Binary(Operator::Multiply, first, rest) => {
            Expression::Binary(Operator::Multiply, scaled(value, first).into(), rest.clone())
        }
        other => Expression::Number(value).times(other.clone()),
    }
}

/// Non-decreasing lists of `degree` numbers below `n`: the monomials of that degree.
fn multisets(n: usize, degree: usize) -> Vec<Vec<usize>> {
    if degree == 0 {
        return vec![vec![]];
    }
    let mut all = Vec::new();
    for shorter in multisets(n, degree - 1) {
        let from = shorter.last().copied().unwrap_or(0);
        all.extend((from..n).map(|j| shorter.iter().copied().chain([j]).collect::<Vec<_>>()));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn library(states: &[&str], controls: &[&str], settings: LibrarySettings) -> Library {
        Library::new(states, controls, &settings).unwrap()
    }

    #[test]
    fn the_libraries_of_the_paper_have_their_sizes() {
        let full = LibrarySettings { products: true, ..LibrarySettings::default() };
        // Order 3, sine, cosine and products over two states: 10 + 4 + 8 + 12.
        assert_eq!(library(&["x1", "x2"], &[], full.clone()).n_terms(), 34);
        // Order 1, sine, cosine and products over four states and two controls: 7 + 12 + 72.
        let car = LibrarySettings { degree: 1, ..full };
        assert_eq!(library(&["x", "y", "v", "a"], &["u1", "u2"], car).n_terms(), 91);
    }

    #[test]
    fn names_and_columns_come_in_the_order_of_the_paper() {
        let settings = LibrarySettings { degree: 1, products: true, ..LibrarySettings::default() };
        let found = library(&["x1", "x2"], &[], settings);
        assert_eq!(found.names()[..7], ["1", "x1", "x2", "sin(x1)", "sin(x2)", "cos(x1)", "cos(x2)"]);
        assert_eq!(
            found.names()[7..],
            [
                "x1*sin(x1)",
                "x1*sin(x2)",
                "x2*sin(x1)",
                "x2*sin(x2)",
                "x1*cos(x1)",
                "x1*cos(x2)",
                "x2*cos(x1)",
                "x2*cos(x2)"
            ]
        );
    }

    #[test]
    fn every_column_is_what_its_name_says() {
        let settings =
            LibrarySettings { products: true, extra: vec!["exp(-x2)*u".into()], ..LibrarySettings::default() };
        let found = library(&["x1", "x2"], &["u"], settings);
        // 11 samples: one more than a whole number of lanes needs.
        let values = Mat::from_fn(11, 3, |i, j| 0.3 * i as f64 - 0.7 * j as f64 + 0.1);
        let time = vec![0.0; 11];
        let theta = found.evaluate(values.as_ref(), &time).unwrap();
        for (j, name) in found.names().iter().enumerate() {
            let single = Tape::new(&[Expression::parse(name).unwrap()], found.variables()).unwrap();
            for i in 0..11 {
                let row: Vec<f64> = (0..3).map(|k| values[(i, k)]).collect();
                let direct = single.evaluate_once(&row, 0.0)[0];
                assert!((theta[(i, j)] - direct).abs() <= 1e-13 * direct.abs().max(1.0), "{name}, row {i}");
            }
        }
    }

    #[test]
    fn terms_are_found_whatever_the_order_of_their_factors() {
        let found = library(&["x1", "x2"], &[], LibrarySettings { products: true, ..LibrarySettings::default() });
        assert_eq!(found.index_of("x2*x1").unwrap(), found.index_of("x1*x2").unwrap());
        assert_eq!(found.index_of("x1*x1").unwrap(), found.index_of("x1^2").unwrap());
        assert_eq!(found.index_of("sin(x1)*x2").unwrap(), found.index_of("x2*sin(x1)").unwrap());
        let error = found.index_of("x1^7").unwrap_err().to_string();
        assert!(error.contains("term `x1^7` is unknown"), "{error}");
    }

    #[test]
    fn a_term_added_twice_is_one_column() {
        let settings =
            LibrarySettings { degree: 2, extra: vec!["x2*x1".into(), "abs(x1)".into()], ..LibrarySettings::default() };
        assert_eq!(library(&["x1", "x2"], &[], settings).n_terms(), 7);
    }

    #[test]
    fn coefficients_make_an_equation_that_reads_back() {
        let found = library(&["x1", "x2"], &[], LibrarySettings { degree: 2, ..LibrarySettings::default() });
        let equation = found.equation(&[0.0, 1.1, 0.0, 0.0, -0.4, 1e-9]);
        assert_eq!(equation.to_string(), "1.1*x1 - 0.4*x1*x2 + 1e-9*x2^2");
        assert_eq!(found.equation(&[-2.0, 0.0, 0.0, 0.0, 0.0, 0.0]).to_string(), "-2");
        assert_eq!(found.equation(&[0.0; 6]).to_string(), "0");
    }

    #[test]
    fn controls_can_stay_out_of_the_polynomials() {
        let settings =
            LibrarySettings { degree: 1, controls: false, extra: vec!["u".into()], ..LibrarySettings::default() };
        assert_eq!(library(&["x"], &["u"], settings).names(), ["1", "x", "u"]);
    }

    #[test]
    fn bad_settings_and_values_are_named() {
        let text = |settings: LibrarySettings| Library::new(&["x"], &[], &settings).unwrap_err().to_string();
        assert!(text(LibrarySettings { degree: 10, ..LibrarySettings::default() }).contains("`degree`"));
        assert!(text(LibrarySettings { extra: vec!["y*x".into()], ..LibrarySettings::default() }).contains("`y`"));
        let found = library(
            &["x"],
            &[],
            LibrarySettings { degree: 0, extra: vec!["log(x)".into()], ..LibrarySettings::default() },
        );
        let error = found.evaluate(Mat::from_fn(1, 1, |_, _| -1.0).as_ref(), &[2.0]).unwrap_err().to_string();
        assert!(error.contains("term `log(x)` at t = 2 s"), "{error}");
        assert!(found.evaluate(Mat::zeros(1, 2).as_ref(), &[0.0]).is_err());
    }
}
