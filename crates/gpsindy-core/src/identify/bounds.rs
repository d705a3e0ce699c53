//! Where a free number that was named without a range may lie: where the logs can show it, by what it is compared with.
//!
//! In `x/(h + x)`, an h below a hundredth of the spread of x changes nothing that is logged, and one above a hundred times the largest x
//! shows in its quotient with the coefficient alone.

use crate::data::{Channel, Dataset};
use crate::error::{Error, Result};
use crate::expression::{Expression, Function, Operator, Tape};
use crate::identify::equations::Equations;
use crate::identify::limits::numbers::{AT_A_BOUND, VISIBLE};
use crate::identify::limits::{POSITIVE, SEARCHED};
use crate::identify::notes::Note;
use crate::identify::settings::Identify;
use crate::library::{FreeNumber, LibrarySettings};

/// How a number stands to a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Relation {
    /// Added to it, or compared with it.
    Beside,
    /// Added to it in a divisor, where the sum must not be 0.
    InDivisor,
    /// The quantity in units of the number is the argument of a function.
    Unit,
    /// Their product stands beside 1, or is the argument of a function.
    Factor,
}

/// Values of a quantity in the logs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Extent {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Standard deviation.
    pub(crate) spread: f64,
}

impl Extent {
    /// Of these values; none where nothing changes.
    pub(crate) fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let spread = (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt();
        let ends = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
        (spread > 0.0).then_some(Self { low, high, spread })
    }

    /// The largest absolute value.
    pub(crate) fn largest(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// 1 where no value is below 0, -1 where none is above; noise does not count.
    pub(crate) fn sign(self) -> f64 {
        match (self.low >= -POSITIVE * self.high.abs(), self.high <= POSITIVE * self.low.abs()) {
            (true, _) => 1.0,
            (_, true) => -1.0,
            _ => 0.0,
        }
    }

    /// Start and bounds of a number that stands so to the quantity.
    fn range(self, relation: Relation) -> ((f64, f64), (f64, f64)) {
        let (small, large) = (self.spread / VISIBLE, VISIBLE * self.largest());
        let sign = self.sign();
        let signed = if sign < 0.0 { (-large, -small) } else { (small, large) };
        match relation {
            Relation::InDivisor if sign != 0.0 => (signed, signed),
            Relation::InDivisor => (signed, (-large, large)),
            Relation::Beside if sign != 0.0 => (signed, (-large, large)),
            Relation::Beside => ((-self.largest(), self.largest()), (-large, large)),
            Relation::Unit => ((small, large), (small, large)),
            Relation::Factor => ((large.recip(), small.recip()), (-small.recip(), small.recip())),
        }
    }
}

impl Identify {
    /// The equations and the terms that were given.
    fn given(&self) -> Result<Vec<Expression>> {
        let terms = self.library.extra.iter().map(|text| Expression::parse(text)).collect::<Result<Vec<_>>>()?;
        Ok(self.constraints.fixed.iter().map(|fixed| fixed.equation.clone()).chain(terms).collect())
    }

    /// That every free number stands in an equation or a term that was given: nothing else can say its value. One with the name of a column is
    /// refused by the library, which says so.
    pub(crate) fn check_numbers(&self, columns: &[Channel]) -> Result<()> {
        if self.library.numbers.is_empty() {
            return Ok(());
        }
        let named: Vec<String> = self.given()?.iter().flat_map(Expression::variables).collect();
        let is_idle = |name: &String| !named.contains(name) && columns.iter().all(|column| column.name != *name);
        match self.library.numbers.iter().find(|number| is_idle(&number.name)) {
            None => Ok(()),
            Some(idle) => Err(Error::Range {
                name: idle.name.clone(),
                expected: "in a term or an equation that is given, as it is a free number".into(),
                found: "it in none".into(),
            }),
        }
    }

    /// These settings with a range for every free number that has none, where the logs say in what range it shows.
    pub(crate) fn with_numbers_bounded(&self, data: &Dataset) -> Result<Option<Self>> {
        if !self.library.numbers.iter().any(FreeNumber::is_unnamed) {
            return Ok(None);
        }
        let parts = self.given()?;
        let given: Vec<&Expression> = parts.iter().collect();
        let bounded = |number: &FreeNumber| match number.is_unnamed() {
            true => self.bounded(number, &given, data),
            false => number.clone(),
        };
        let numbers = self.library.numbers.iter().map(bounded).collect();
        Ok(Some(Self { library: LibrarySettings { numbers, ..self.library.clone() }, ..self.clone() }))
    }

    /// The number with the hull of the ranges that its places ask for; unchanged where none says anything.
    fn bounded(&self, number: &FreeNumber, given: &[&Expression], data: &Dataset) -> FreeNumber {
        let mut found = Vec::new();
        given.iter().for_each(|part| relations(part, &number.name, false, &mut found));
        let ranges = found.iter().filter_map(|(part, relation)| Some(self.extent(part, data)?.range(*relation)));
        let hull = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        match ranges.reduce(|a, b| (hull(a.0, b.0), hull(a.1, b.1))) {
            Some((start, bounds)) => FreeNumber { start, bounds, ..number.clone() },
            None => number.clone(),
        }
    }

    /// Values of an expression in the part of the logs that is learnt from; none where it names what is not logged.
    fn extent(&self, part: &Expression, data: &Dataset) -> Option<Extent> {
        let names = part.variables();
        let columns = data.indices_of(&names).ok()?;
        let tape = Tape::new(std::slice::from_ref(part), &names).ok()?;
        let stride = data.n_samples() / SEARCHED + 1;
        let values = data.runs().iter().flat_map(|run| {
            let end = run.time.partition_point(|t| *t <= self.training_end(run));
            let row = |i: usize| columns.iter().map(|&c| run.values[(i, c)]).collect::<Vec<f64>>();
            (0..end).step_by(stride).map(|i| tape.evaluate_once(&row(i), run.time[i])[0]).collect::<Vec<f64>>()
        });
        Extent::of(values)
    }
}

/// Quantities that the number `name` stands beside in `part`, which is within a divisor or not.
fn relations(part: &Expression, name: &str, divides: bool, found: &mut Vec<(Expression, Relation)>) {
    use Expression as E;
    let is_own = |part: &E| matches!(part, E::Variable(own) if own == name);
    let mut push = |quantity: &E, relation| {
        let mut is_plain = !quantity.contains(name);
        quantity.visit(&mut |one| match one {
            E::Time | E::Simulator(..) => is_plain = false,
            E::Call(function, _) => is_plain &= !function.has_memory(),
            _ => {}
        });
        if is_plain {
            found.push((quantity.clone(), relation));
        }
    };
    match part {
        E::Binary(Operator::Add | Operator::Subtract, a, b) => {
            for (own, other) in [(a, b), (b, a)] {
                match (&**own, &**other) {
                    (own, other) if is_own(own) => {
                        push(other, if divides { Relation::InDivisor } else { Relation::Beside });
                    }
                    (E::Binary(Operator::Multiply, p, q), E::Number(one)) if is_own(p) || is_own(q) => {
                        let factor = if is_own(p) { q } else { p };
                        push(&(**factor).clone().over(E::Number(*one)), Relation::Factor);
                    }
                    _ => {}
                }
            }
        }
        E::Call(Function::Min | Function::Max | Function::DeadZone | Function::Clamp, parts) => {
            for own in parts.iter().filter(|own| is_own(own)) {
                parts.iter().filter(|other| *other != own).for_each(|other| push(other, Relation::Beside));
            }
        }
        E::Call(Function::Exp | Function::Tanh | Function::Atan, parts) => match bare(&parts[0]) {
            E::Binary(Operator::Divide, quantity, own) if is_own(own) => push(quantity, Relation::Unit),
            E::Binary(Operator::Multiply, p, q) if is_own(p) => push(q, Relation::Factor),
            E::Binary(Operator::Multiply, p, q) if is_own(q) => push(p, Relation::Factor),
            _ => {}
        },
        _ => {}
    }
    match part {
        E::Negate(inner) => relations(inner, name, divides, found),
        E::Binary(Operator::Divide, a, b) => {
            relations(a, name, divides, found);
            relations(b, name, true, found);
        }
        E::Binary(_, a, b) => [a, b].into_iter().for_each(|inner| relations(inner, name, divides, found)),
        E::Call(_, parts) => parts.iter().for_each(|inner| relations(inner, name, false, found)),
        _ => {}
    }
}

/// The argument of a function without its sign and without a power of it as a whole.
fn bare(part: &Expression) -> &Expression {
    match part {
        Expression::Negate(inner) => bare(inner),
        Expression::Binary(Operator::Power, base, exponent) if matches!(**exponent, Expression::Number(_)) => {
            bare(base)
        }
        _ => part,
    }
}

impl Equations {
    /// A remark for every free number in use that ended at a bound.
    pub(crate) fn numbers_at_bounds(&self) -> Vec<Note> {
        let numbers = self.library.numbers();
        let is_at = |value: f64, bound: f64| (value - bound).abs() <= AT_A_BOUND * bound.abs();
        let ended = self.free_numbers().into_iter().filter(|&k| {
            let (low, high) = self.bounds[k];
            is_at(numbers[k].1, low) || is_at(numbers[k].1, high)
        });
        ended.map(|k| Note::AtBound { number: numbers[k].0.clone(), value: numbers[k].1 }).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::Run;
    use crate::identify::tests::log;
    use crate::library::{Constraints, Fixed};
    use crate::progress::Silent;
    use crate::refine::Hold;
    use faer::Mat;

    fn named(text: &str) -> LibrarySettings {
        let numbers = vec![FreeNumber::parse(text).unwrap()];
        LibrarySettings { degree: 1, numbers, ..LibrarySettings::default() }
    }

    /// Start and bounds of h in an equation of x, logged from 1000 to 3000, and v, from -2 to 2.
    fn range(number: &str, equation: &str) -> ((f64, f64), (f64, f64)) {
        let value = |i: usize, j: usize| if j == 0 { 1000.0 + 20.0 * i as f64 } else { -2.0 + 0.04 * i as f64 };
        let time = (0..101).map(f64::from).collect();
        let run = Run { name: "a".into(), time, values: Mat::from_fn(101, 2, value) };
        let data = Dataset::new(vec![Channel::new("x"), Channel::new("v")], vec![run]).unwrap();
        let fixed = vec![Fixed::parse(equation).unwrap()];
        let constraints = Constraints { fixed, ..Constraints::default() };
        let settings = Identify { library: named(number), constraints, ..Identify::default() };
        let bounded = settings.with_numbers_bounded(&data).unwrap().unwrap_or(settings);
        (bounded.library.numbers[0].start, bounded.library.numbers[0].bounds)
    }

    #[test]
    fn a_number_that_stands_nowhere_is_refused() {
        let with = |equation: &str, extra: &[&str]| {
            let fixed = vec![Fixed::parse(equation).unwrap()];
            let extra = extra.iter().map(ToString::to_string).collect();
            let library = LibrarySettings { extra, ..named("h") };
            let constraints = Constraints { fixed, ..Constraints::default() };
            Identify { library, constraints, ..Identify::default() }.check_numbers(&[Channel::new("x")])
        };
        assert!(with("x' = h*v", &[]).is_ok() && with("x' = v", &["x/(h + x)"]).is_ok());
        let refused = with("x' = v", &["x^3"]).unwrap_err().to_string();
        assert_eq!(
            refused,
            "`h` must be in a term or an equation that is given, as it is a free number, found it in none"
        );
    }

    #[test]
    fn a_number_lies_where_the_logs_can_show_it() {
        // The spread of x is 583, that of v is 1.17.
        let near = |found: (f64, f64), low: f64, high: f64| {
            let off = |value: f64, truth: f64| (value - truth).abs() > 0.01 * truth.abs();
            assert!(!off(found.0, low) && !off(found.1, high), "{found:?}, not {low} to {high}");
        };
        let (start, bounds) = range("h", "x' = x/(h + x)");
        near(start, 5.83, 3e5);
        near(bounds, 5.83, 3e5);
        let (start, bounds) = range("h", "x' = max(h - x, 0)");
        near(start, 5.83, 3e5);
        near(bounds, -3e5, 3e5);
        near(range("h", "v' = -max(v - h, 0)").0, -2.0, 2.0);
        near(range("h", "v' = tanh(v/h)").1, 0.0117, 200.0);
        near(range("h", "v' = v/(1 + h*x)").0, 1.0 / 3e5, 1.0 / 5.83);
    }

    #[test]
    fn a_range_that_was_named_stays_and_so_does_one_that_nothing_logged_says() {
        let usual = FreeNumber::parse("h").unwrap();
        let named = FreeNumber::parse("h=0.01:100").unwrap();
        assert_eq!(range("h=0.01:100", "x' = x/(h + x)"), (named.start, named.bounds));
        for equation in ["x' = h*x", "x' = sin(h*t)", "x' = x + h*v", "x' = x^h"] {
            assert_eq!(range("h", equation), (usual.start, usual.bounds), "{equation}");
        }
    }

    #[test]
    fn a_number_that_the_logs_only_bound_is_said_to_be() {
        let inflow = |t: f64| 30.0 + 20.0 * (0.7 * t).sin();
        // This rate does not saturate at all: h is only known to be large.
        let steep = |t: f64, x: &[f64]| vec![inflow(t) - 0.05 * x[0] - 0.0002 * x[0] * x[0]];
        let curve = |t: f64, x: &[f64]| vec![inflow(t) - 60.0 * x[0] / (200.0 + x[0])];
        let noted = |rate: &dyn Fn(f64, &[f64]) -> Vec<f64>| {
            let data = log(&["x", "u"], &[300.0], rate, (0.5, 300), 1.0, &|t| vec![inflow(t)], 3);
            let fixed = vec![Fixed::parse("x' = u - k*x*h/(h + x)").unwrap()];
            let numbers = vec![FreeNumber::parse("h").unwrap(), FreeNumber::parse("k").unwrap()];
            let found = Identify {
                states: vec!["x".into()],
                controls: vec!["u".into()],
                library: LibrarySettings { numbers, ..named("h") },
                constraints: Constraints { fixed, ..Constraints::default() },
                hold: Some(Hold::Linear),
                ..Identify::default()
            };
            found.fit(&data, &Silent).unwrap().notes
        };
        let at_bound = |note: &Note| matches!(note, Note::AtBound { number, .. } if number == "h");
        let steep = noted(&steep);
        assert!(steep.iter().any(at_bound), "{steep:?}");
        let curve = noted(&curve);
        assert!(!curve.iter().any(at_bound), "{curve:?}");
    }
}
