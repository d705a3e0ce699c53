//! Where the search for free numbers begins: of several sets of values the one whose rollouts, refined, follow the logs best.

use crate::data::{Channel, Dataset, Run};
use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::Algorithm1;
use crate::identify::algorithm1::smooth::{Motion, smooth};
use crate::identify::excerpt::excerpt;
use crate::identify::limits::SEARCHED;
use crate::identify::limits::numbers::{FIRST_STARTS, KEPT_STARTS, MOST_STARTS};
use crate::identify::prepare::{Logs, prepare};
use crate::identify::searched::Searched;
use crate::identify::settings::Identify;
use crate::identify::support::fit::Fitter;
use crate::identify::support::scope::{Member, Scope};
use crate::library::{FreeNumber, LibrarySettings};
use crate::parallel;
use crate::progress::{Progress, Silent, step};
use faer::Mat;

/// The first prime numbers, one a dimension of the sequence of Halton 1960. Exact.
const PRIMES: [usize; 12] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37];

/// What the search for free numbers came to.
pub(crate) struct Started {
    /// The settings, with one value for every number.
    pub(crate) settings: Identify,
    /// The equations as they are then, and what they were fitted to; none where nothing is refined.
    found: Option<(Algorithm1, Member)>,
    /// Whether that is all of the logs.
    whole: bool,
}

impl Started {
    /// The result where no equation has a term to be found: what the numbers came to, fitted to all of `data`.
    pub(crate) fn into_given(self, data: &Dataset, progress: &dyn Progress) -> Result<(Identify, Option<Searched>)> {
        let Self { settings, found, whole } = self;
        let Some((done, member)) = found.filter(|(done, _)| done.rows.iter().all(Option::is_none)) else {
            return Ok((settings, None));
        };
        let searched = Searched { settings: settings.clone(), done, member: Some(member), notes: Vec::new() };
        let searched = if whole { Some(searched) } else { searched.fitted_to(&settings, data, progress)? };
        Ok((settings, searched))
    }
}

impl Identify {
    /// These settings with one value to begin at for every free number; none where they have that already.
    pub(crate) fn with_numbers_started(&self, data: &Dataset, progress: &dyn Progress) -> Result<Option<Started>> {
        let open = self.library.numbers.iter().filter(|number| number.is_open()).count();
        if open == 0 {
            return Ok(None);
        }
        let middle = self.at(&self.library.numbers.iter().map(FreeNumber::middle).collect::<Vec<f64>>());
        if !self.refine {
            return Ok(Some(Started { settings: middle, found: None, whole: false }));
        }
        let part = excerpt(&middle, data, SEARCHED)?.map(|(part, _)| part);
        let whole = part.is_none();
        let (part, middle) = match part {
            Some(part) => (part, Self { train_fraction: 1.0, ..middle }),
            None => (data.clone(), middle),
        };
        let logs = prepare(&middle, &part, progress)?;
        let motion = smooth(&middle, &logs, progress)?;
        let base = Base { settings: &middle, known: without_noise(&middle, &logs, &motion)?, logs, motion };
        let count = FIRST_STARTS.saturating_mul(1 << (open - 1).min(8)).min(MOST_STARTS);
        let draws: Vec<Vec<f64>> = (1..=count).map(|k| self.draw(k)).collect();
        step(progress, "start numbers", 0, 2)?;
        let tried = parallel::map(&draws, |draw| unless_cancelled(base.tried(draw)));
        let tried: Vec<Tried> = tried.into_iter().collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
        let order = ranked(tried.iter().map(|one| (&one.done, &one.member)));
        let kept: Vec<&Tried> = order.iter().take(KEPT_STARTS).map(|&k| &tried[k]).collect();
        step(progress, "start numbers", 1, 2)?;
        let longer = parallel::try_map(&kept, |one| base.longer(one))?;
        let longer: Vec<Tried> = longer.into_iter().flatten().collect();
        let best = base.best(longer)?.ok_or_else(nothing)?;
        let numbers = best.member.trial.equations.library.numbers();
        let settings = self.at(&numbers.iter().map(|(_, value)| *value).collect::<Vec<f64>>());
        Ok(Some(Started { settings, found: Some((best.done, best.member)), whole }))
    }

    /// These settings with the free numbers at these values.
    fn at(&self, values: &[f64]) -> Self {
        let numbers = self.library.numbers.iter().zip(values).map(|(number, &value)| number.fixed_at(value)).collect();
        Self { library: LibrarySettings { numbers, ..self.library.clone() }, ..self.clone() }
    }

    /// Values of all free numbers: set number `k` of an even cover of their ranges.
    fn draw(&self, k: usize) -> Vec<f64> {
        let mut primes = PRIMES.iter().cycle();
        let numbers = self.library.numbers.iter();
        numbers
            .map(|number| number.at(if number.is_open() { halton(k, *primes.next().unwrap_or(&2)) } else { 0.5 }))
            .collect()
    }
}

fn nothing() -> crate::error::Error {
    crate::error::Error::settings(
        "from no start value of the free numbers do rollouts follow the logs; name other ones, as NAME=LOW:HIGH",
    )
}

/// Member `k` of the van der Corput sequence in base `prime`.
fn halton(mut k: usize, prime: usize) -> f64 {
    let (mut value, mut share) = (0.0, 1.0);
    while k > 0 {
        share /= prime as f64;
        value += share * (k % prime) as f64;
        k /= prime;
    }
    value
}

/// Equations fitted from one set of values.
#[derive(Clone)]
struct Tried {
    done: Algorithm1,
    member: Member,
    /// Whether the rollouts grew no further than they stay on course.
    on_course: bool,
}

/// Places of fits of the same logs, the best evidence first.
fn ranked<'a>(fits: impl Iterator<Item = (&'a Algorithm1, &'a Member)>) -> Vec<usize> {
    let fits: Vec<(&Algorithm1, &Member)> = fits.collect();
    let Some((done, member)) = fits.first() else { return Vec::new() };
    let fitter = Fitter::new(&done.logs, &done.motion, member.hold);
    fitter.ranked(fits.iter().map(|(_, member)| &member.trial))
}

/// What the sets of values are tried on.
struct Base<'a> {
    settings: &'a Identify,
    /// The logs with smoothed states.
    known: Dataset,
    logs: Logs,
    motion: Motion,
}

impl Base<'_> {
    /// Short rollouts fitted from one set of values.
    fn tried(&self, draw: &[f64]) -> Result<Tried> {
        let settings = self.settings.at(draw);
        let raw = Identify { smoother: None, ranges: Vec::new(), train_fraction: 1.0, ..settings.clone() };
        let mut logs = prepare(&raw, &self.known, &Silent)?;
        logs.frame.ranges.clone_from(&self.logs.frame.ranges);
        logs.frame.delays.clone_from(&self.logs.frame.delays);
        logs.measured = self.logs.measured.clone();
        logs.notes.clone_from(&self.logs.notes);
        let (noise, kernels) = (self.motion.noise.clone(), self.motion.kernels.clone());
        let notes = self.motion.notes.clone();
        let motion = Motion { noise, kernels, notes, ..smooth(&raw, &logs, &Silent)? };
        let done = Algorithm1::of(&settings, logs, motion, &Silent)?;
        let hold = done.timings.best.hold;
        let scope = Scope::new(&settings, &done, &Silent);
        let window = scope.rollouts().shortest();
        let trial = scope.fitter(hold).fit(&done.regressed.equations, window, None)?;
        Ok(Tried { done, member: Member { trial, window, hold, rival: None }, on_course: true })
    }

    /// The same fitted to longer rollouts for as long as they stay on course, and to all lengths beyond.
    fn longer(&self, one: &Tried) -> Result<Vec<Tried>> {
        let scope = Scope::new(self.settings, &one.done, &Silent);
        let stretched = scope.stretch(&scope.fitter(one.member.hold), one.member.trial.clone(), scope.rollouts());
        let Some((trial, window)) = unless_cancelled(stretched)? else { return Ok(vec![one.clone()]) };
        let on_course = Member { trial, window, ..one.member.clone() };
        let beyond = match self.settings.window {
            None => scope.with_longer_rollouts(&on_course)?,
            Some(_) => Vec::new(),
        };
        let with = |member, on_course| Tried { member, on_course, ..one.clone() };
        Ok(std::iter::once(with(on_course, true)).chain(beyond.into_iter().map(|member| with(member, false))).collect())
    }

    /// The best evidence of the longest rollouts that stay on course; where those are no whole runs although whole runs can be foretold,
    /// what predicts whole runs best.
    fn best(&self, all: Vec<Tried>) -> Result<Option<Tried>> {
        let longest = all.iter().filter(|one| one.on_course).map(|one| one.member.window).fold(0.0, f64::max);
        let is_longest = |one: &Tried| one.on_course && one.member.window == longest;
        let usual: Vec<Tried> = all.iter().filter(|one| is_longest(one)).cloned().collect();
        let order = ranked(usual.iter().map(|one| (&one.done, &one.member)));
        let Some(usual) = order.first().map(|&k| usual[k].clone()) else { return Ok(None) };
        let is_whole = longest >= self.motion.longest_run();
        if is_whole || Scope::new(self.settings, &usual.done, &Silent).is_unforeseeable(&usual.member)? {
            return Ok(Some(usual));
        }
        let (mut best, mut least) = (usual, f64::INFINITY);
        for one in all {
            let scope = Scope::new(self.settings, &one.done, &Silent);
            let miss = scope.miss_of(&one.done.regressed, Some(&one.member))?.unwrap_or(f64::INFINITY);
            if miss < least {
                (best, least) = (one, miss);
            }
        }
        Ok(Some(best))
    }
}

/// The logged columns of the training part, its states smoothed.
fn without_noise(settings: &Identify, logs: &Logs, motion: &Motion) -> Result<Dataset> {
    let data = &logs.data;
    let columns: Vec<usize> = (0..data.channels().len()).filter(|c| !logs.unmeasured.contains(c)).collect();
    let name = |c: usize| {
        let state = logs.rates.iter().position(|rate| *rate == Some(c));
        let column = state.and_then(|s| settings.derivatives.iter().find(|(name, _)| *name == settings.states[s]));
        column.map_or_else(|| data.channels()[c].clone(), |(_, column)| Channel::new(column))
    };
    let runs = data.runs().iter().zip(&motion.tracks).map(|(run, track)| {
        let value = |i: usize, c: usize| if c < track.mean.ncols() { track.mean[(i, c)] } else { run.values[(i, c)] };
        Run { values: Mat::from_fn(run.n_samples(), columns.len(), |i, j| value(i, columns[j])), ..run.clone() }
    });
    Dataset::new(columns.iter().map(|&c| name(c)).collect(), runs.collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::identify::SensorRange;
    use crate::identify::result::Identification;
    use crate::identify::tests::log;
    use crate::library::{Constraints, Fixed};
    use crate::refine::Hold;

    fn number(found: &Identification, name: &str) -> (f64, f64) {
        let number = found.model.parameters.iter().find(|number| number.name == name).unwrap();
        (number.value, number.tolerance.unwrap() * number.value.abs())
    }

    fn is_near(found: &Identification, name: &str, truth: f64) {
        let (value, error) = number(found, name);
        assert!((value - truth).abs() < 4.0 * error && error < 0.1 * truth, "{name}: {value} +- {error}, not {truth}");
    }

    fn settings(states: &[&str], numbers: &[&str]) -> Identify {
        let numbers = numbers.iter().map(|text| FreeNumber::parse(text).unwrap()).collect();
        let library = LibrarySettings { degree: 1, numbers, ..LibrarySettings::default() };
        let states = states.iter().map(ToString::to_string).collect();
        Identify { states, library, grow: false, ..Identify::default() }
    }

    #[test]
    fn a_saturating_rate_gets_its_half_saturation() {
        let rate = |t: f64, x: &[f64]| vec![0.6 + 0.5 * (0.7 * t).sin() - 1.5 * x[0] / (0.8 + x[0])];
        let data = log(&["x", "u"], &[0.3], &rate, (0.2, 300), 0.01, &|t| vec![0.6 + 0.5 * (0.7 * t).sin()], 3);
        let mut identify = settings(&["x"], &["h"]);
        (identify.controls, identify.hold) = (vec!["u".into()], Some(Hold::Linear));
        identify.library.extra = vec!["x/(h + x)".into()];
        let found = identify.fit(&data, &Silent).unwrap();
        assert_eq!(found.states[0].terms, ["u", "x/(h + x)"]);
        is_near(&found, "h", 0.8);
    }

    /// Two tanks; the log has the lower level alone, which its sensor shows up to `end`.
    fn tanks(end: f64) -> Dataset {
        let inflow = |t: f64| 1.0 + 0.6 * (0.13 * t).sin() + 0.3 * (0.41 * t).cos();
        let rate = |t: f64, x: &[f64]| {
            let through = 0.5 * x[0].max(0.0).sqrt();
            vec![0.4 * inflow(t) - through, through - 0.35 * x[1].max(0.0).sqrt()]
        };
        let data = log(&["h", "y", "u"], &[0.8, 1.0], &rate, (0.5, 400), 0.01, &|t| vec![inflow(t)], 11);
        let run = &data.runs()[0];
        let value = |i: usize, j: usize| if j == 0 { run.values[(i, 1)].min(end) } else { run.values[(i, 2)] };
        let values = Mat::from_fn(run.n_samples(), 2, value);
        Dataset::new(vec![Channel::new("y"), Channel::new("u")], vec![Run { values, ..run.clone() }]).unwrap()
    }

    fn of_tanks(numbers: &[&str], equations: &[&str]) -> Identify {
        let fixed = equations.iter().map(|text| Fixed::parse(text).unwrap()).collect();
        Identify {
            controls: vec!["u".into()],
            hold: Some(Hold::Linear),
            constraints: Constraints { fixed, ..Constraints::default() },
            ..settings(&["y", "h"], numbers)
        }
    }

    // With the hidden level in units in which its outflow is its root.
    const LOWER: &str = "y' = sqrt(max(h, 0)) - b*sqrt(max(y, 0))";

    #[test]
    fn tanks_of_which_one_level_is_logged_get_the_numbers_of_both() {
        let identify = of_tanks(&["b", "k", "q"], &[LOWER, "h' = k*u - q*sqrt(max(h, 0))"]);
        let found = identify.fit(&tanks(f64::INFINITY), &Silent).unwrap();
        for (name, truth) in [("b", 0.35), ("k", 0.1), ("q", 0.25)] {
            is_near(&found, name, truth);
        }
    }

    #[test]
    fn the_equation_of_a_hidden_level_is_found() {
        let mut identify = of_tanks(&["b"], &[LOWER]);
        identify.library.extra = vec!["sqrt(max(h, 0))".into()];
        let found = identify.fit(&tanks(f64::INFINITY), &Silent).unwrap();
        assert_eq!(found.states[1].terms, ["u", "sqrt(max(h, 0))"]);
        is_near(&found, "b", 0.35);
    }

    #[test]
    fn a_sensor_with_an_end_spoils_nothing_once_its_range_is_given() {
        let data = tanks(1.5);
        let shown = data.runs()[0].column(0).iter().filter(|y| **y == 1.5).count();
        assert!(shown > 20, "{shown} samples at the end");
        let mut identify = of_tanks(&["b", "k", "q"], &[LOWER, "h' = k*u - q*sqrt(max(h, 0))"]);
        let without = identify.fit(&data, &Silent).unwrap();
        assert!(without.notes.iter().any(|note| note.to_string().contains("give its range")), "{:?}", without.notes);
        identify.ranges = vec![SensorRange::parse("y=:1.5").unwrap()];
        let found = identify.fit(&data, &Silent).unwrap();
        assert_eq!(found.model.states[0].measured.as_ref().unwrap().to_string(), "min(y, 1.5)");
        for (name, truth) in [("b", 0.35), ("k", 0.1), ("q", 0.25)] {
            is_near(&found, name, truth);
        }
    }
}
