//! Rates that saturate: `x/(h + x)` (Michaelis and Menten, Monod, Holling's second type) and `x^2/(h^2 + x^2)` (Hill, Holling's third
//! type), alone and times another variable, h a free number. They are tried where the terms of a library leave more than the noise, and
//! where it takes many of them, and taken by the rule of every larger library.

use crate::data::Dataset;
use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::Algorithm1;
use crate::identify::bounds::Extent;
use crate::identify::grow::grown_note;
use crate::identify::limits::MOST_GROWN;
use crate::identify::limits::numbers::VISIBLE;
use crate::identify::limits::saturating::{KEPT, LEAST, LONG, MOST_VARIABLES, REACHED, SCANNED, SEEN};
use crate::identify::searched::Searched;
use crate::identify::settings::Identify;
use crate::identify::support::scope::Scope;
use crate::library::{FreeNumber, Library, LibrarySettings};
use crate::progress::{Progress, Silent};

/// The powers of a variable in its term.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Order {
    First,
    Second,
}

impl Searched {
    /// Whether a larger library may explain the logs better.
    pub(crate) fn leaves_structure(&self, progress: &dyn Progress) -> Result<bool> {
        let scope = Scope::new(&self.settings, &self.done, progress);
        self.member.as_ref().map_or(Ok(true), |found| scope.leaves_structure(found))
    }

    /// Whether an equation has so many terms that one that saturates may stand for some of them.
    pub(crate) fn is_long(&self) -> bool {
        let equations = self.member.as_ref().map_or(&self.done.regressed.equations, |member| &member.trial.equations);
        (0..equations.n_states()).any(|s| equations.support.terms(s).len() >= LONG)
    }

    /// The same, or the equations with rates that saturate where they are clearly better. `asked` has the library that was asked for.
    pub(crate) fn saturating(mut self, asked: &Identify, progress: &dyn Progress) -> Result<Self> {
        let mut library = asked.library.clone();
        for _ in 0..asked.states.len() + asked.controls.len() {
            let Some(better) = self.with_one_more(asked, &library, progress)? else { break };
            library.clone_from(&better.settings.library);
            self = better;
            if !self.leaves_structure(progress)? {
                break;
            }
        }
        Ok(self)
    }

    /// Equations over `library` and the terms of one variable that saturate, where they are clearly better.
    fn with_one_more(
        &self,
        asked: &Identify,
        library: &LibrarySettings,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        // Without a refinement there is no evidence to compare: long rollouts alone, in chaos above all, differ by luck.
        let Some(base) = &self.member else { return Ok(None) };
        let scope = Scope::new(&self.settings, &self.done, progress);
        let mut tried: Vec<(f64, Identify, Algorithm1)> = Vec::new();
        for library in larger(asked, library, &self.done.logs.data)? {
            let mut best: Option<(f64, Identify, Algorithm1)> = None;
            for k in 0..SCANNED {
                let mut library = library.clone();
                let Some(number) = library.numbers.last_mut() else { continue };
                *number = number.fixed_at(number.at((k as f64 + 0.5) / SCANNED as f64));
                let settings = Identify { library, grow: false, ..asked.clone() };
                let done = Algorithm1::with_library_of(&settings, (scope.logs, scope.motion), &Silent);
                let Some(done) = unless_cancelled(done)? else { continue };
                let score = misfit(&done);
                if best.as_ref().is_none_or(|(least, ..)| score < *least) {
                    best = Some((score, settings, done));
                }
            }
            scope.keep_going()?;
            if let Some(best) = best
                && scope.may_explain(Some(base), &best.2)?
            {
                tried.push(best);
            }
        }
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, settings, done) in tried.into_iter().take(KEPT) {
            let mut done = settings.chosen(done, progress)?;
            done.timings = done.timings.of(base.hold);
            let mut notes = Vec::new();
            let other = Scope::new(&settings, &done, progress);
            let member = other.equations(&done.regressed, &mut notes)?;
            let Some(found) = &member else { continue };
            // Without a number in use it is a polynomial by another route, and so it is with one that ended where it was looked for.
            let equations = &found.trial.equations;
            if equations.free_numbers().is_empty() || !equations.numbers_at_bounds().is_empty() {
                continue;
            }
            let grown = (&done.regressed, Some(found));
            if !scope.is_surpassed((&self.done.regressed, Some(base)), &other, grown)? {
                continue;
            }
            let asked = Library::new(&asked.states, &asked.controls, &asked.library)?;
            notes.push(grown_note(&found.trial.equations, &asked));
            return Ok(Some(Self { settings, done, member, notes }));
        }
        Ok(None)
    }
}

/// The regression's evidence, up to a constant: the smaller, the better.
fn misfit(done: &Algorithm1) -> f64 {
    let n = done.logs.data.n_samples() as f64;
    let terms = done.regressed.equations.n_terms() as f64;
    let chosen = done.regressed.chosen.iter().flatten();
    let one =
        |residual: f64, terms_in: usize| n * residual.max(LEAST).ln() + terms_in as f64 * (n.ln() + 2.0 * terms.ln());
    chosen.map(|c| one(c.residual, c.coefficients.iter().filter(|value| **value != 0.0).count())).sum()
}

/// `library` with the terms of one variable, once for every variable and order that the logs allow; their number is the last one.
fn larger(asked: &Identify, library: &LibrarySettings, data: &Dataset) -> Result<Vec<LibrarySettings>> {
    let variables: Vec<&String> = asked.states.iter().chain(&asked.controls).collect();
    let mut found = Vec::new();
    if variables.len() > MOST_VARIABLES {
        return Ok(found);
    }
    for (c, x) in variables.iter().enumerate() {
        let values = data.runs().iter().flat_map(|run| run.column(c).iter().copied());
        let Some(extent) = Extent::of(values) else { continue };
        for order in [Order::First, Order::Second] {
            // The sum in the divisor must not cross 0.
            if order == Order::First && extent.sign() <= 0.0 {
                continue;
            }
            let Some(number) = number(x, order, extent, &variables, library) else { continue };
            let h = number.name.clone();
            let rates = match order {
                Order::First => vec![format!("{x}/({h} + {x})")],
                Order::Second => vec![format!("{x}/({h}^2 + {x}^2)"), format!("{x}^2/({h}^2 + {x}^2)")],
            };
            let others = || variables.iter().filter(|other| *other != x);
            let times = rates.iter().flat_map(|rate| others().map(move |other| format!("{other}*{rate}")));
            let extra = [library.extra.clone(), rates.clone(), times.collect()].concat();
            let numbers = [library.numbers.clone(), vec![number]].concat();
            let larger = LibrarySettings { extra, numbers, ..library.clone() };
            if Library::new(&asked.states, &asked.controls, &larger)?.n_terms() <= MOST_GROWN {
                found.push(larger);
            }
        }
    }
    Ok(found)
}

/// The value of `x` at which a rate is half of its largest; none where `library` has it, or a variable is called so.
fn number(
    x: &str,
    order: Order,
    extent: Extent,
    variables: &[&String],
    library: &LibrarySettings,
) -> Option<FreeNumber> {
    let name = match order {
        Order::First => format!("h_{x}"),
        Order::Second => format!("h2_{x}"),
    };
    let is_taken = variables.iter().any(|other| **other == name) || library.numbers.iter().any(|n| n.name == name);
    // Below 0 there is noise alone.
    let least = |ratio: f64| (extent.spread / ratio).max(if order == Order::First { -2.0 * extent.low } else { 0.0 });
    let most = REACHED * extent.largest();
    let (start, bounds) = ((least(SEEN), most), (least(VISIBLE), most));
    (!is_taken && start.0 < start.1).then_some(FreeNumber { name, start, bounds })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::identify::notes::Note;
    use crate::identify::result::Identification;
    use crate::identify::tests::log;

    fn found(
        states: &[&str],
        start: &[f64],
        rate: &dyn Fn(&[f64]) -> Vec<f64>,
        noise: f64,
        seed: u64,
    ) -> Identification {
        let data = log(states, start, &|_, x| rate(x), (0.1, 300), noise, &|_| vec![], seed);
        let states = states.iter().map(ToString::to_string).collect();
        Identify { states, ..Identify::default() }.fit(&data, &Silent).unwrap()
    }

    fn is_rational(found: &Identification) -> bool {
        found.notes.iter().any(|note| matches!(note, Note::Grown { terms } if terms.iter().any(|t| t.contains("/("))))
    }

    #[test]
    fn predators_that_are_sated_get_their_half_saturation() {
        let rate = |x: &[f64]| {
            let eaten = x[0] * x[1] / (0.6 + x[0]);
            vec![1.5 * x[0] - 0.5 * x[0] * x[0] - eaten, 0.8 * eaten - 0.4 * x[1]]
        };
        let found = found(&["x", "y"], &[0.5, 1.0], &rate, 0.001, 5);
        assert!(is_rational(&found), "{:?} {:?}", found.notes, found.model.states);
        let half = found.model.parameters.iter().find(|number| number.name == "h_x").unwrap();
        assert!((half.value - 0.6).abs() < 4.0 * half.tolerance.unwrap() * half.value, "{half:?}");
        assert_eq!(found.states[1].terms, ["y", "y*x/(h_x + x)"]);
    }

    #[test]
    fn polynomials_stay_polynomials() {
        let prey = |x: &[f64]| vec![1.1 * x[0] - 0.4 * x[0] * x[1], 0.4 * x[0] * x[1] - x[1]];
        let van_der_pol = |x: &[f64]| vec![x[1], 1.5 * x[1] - 1.5 * x[0] * x[0] * x[1] - x[0]];
        for (seed, noise) in [(1, 0.0), (2, 0.001), (3, 0.02), (4, 0.1)] {
            for rate in [&prey as &dyn Fn(&[f64]) -> Vec<f64>, &van_der_pol] {
                let found = found(&["x", "y"], &[1.0, 0.5], rate, noise, seed);
                assert!(!is_rational(&found) && found.model.parameters.is_empty(), "{noise} {:?}", found.notes);
            }
        }
    }
}
