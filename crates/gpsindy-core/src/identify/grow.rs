//! Grows the library where its terms leave more than the noise: waves, products of waves, and the functions that a positive or a
//! signed quantity allows. The larger library must pay for its size, since every term costs more among more candidates.

use crate::data::Dataset;
use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::Algorithm1;
use crate::identify::algorithm1::regress::Regressed;
use crate::identify::equations::Equations;
use crate::identify::limits::{DEPENDENT_SHARE, EXACT, GROWN, MOST_GROWN, ON_COURSE, POSITIVE, WORTH_MORE};
use crate::identify::notes::Note;
use crate::identify::searched::Searched;
use crate::identify::settings::Identify;
use crate::identify::support::fit::{Fitter, Trial};
use crate::identify::support::scope::{Member, Scope};
use crate::library::{Library, LibrarySettings};
use std::cmp::Ordering;

impl Scope<'_> {
    /// Whether a larger library may explain the logs better: the equations leave more than the noise, or follow no whole run although
    /// they could.
    pub(crate) fn leaves_structure(&self, found: &Member) -> Result<bool> {
        let is_short = found.window < self.motion.longest_run();
        // What follows itself from sample to sample is no noise, whatever the smoother holds for it.
        let is_noise = found.trial.share > DEPENDENT_SHARE;
        Ok(self.leaves_more(found, WORTH_MORE, is_noise) || (is_short && !self.is_unforeseeable(found)?))
    }

    /// Whether some column is left with more than its noise, where it is one, and this share of its spread.
    fn leaves_more(&self, found: &Member, least: f64, is_noise: bool) -> bool {
        let columns = found.trial.noise.iter().zip(&self.motion.noise).zip(&self.motion.spread);
        // Noise that small is the smoother's own limit, not the log's.
        let noise = |noise: f64, spread: f64| if is_noise && noise > EXACT * spread { ON_COURSE * noise } else { 0.0 };
        let mut left = columns.map(|((left, own), spread)| *left > noise(*own, *spread).max(least * spread));
        left.any(|left| left)
    }

    /// The equations of a larger library, where they are clearly better than `base`, or than the regression where nothing refined predicts
    /// whole runs as well.
    pub(crate) fn grown(&self, base: (&Regressed, Option<&Member>)) -> Result<Option<Searched>> {
        let Some(library) = larger(self.settings, &self.logs.data)? else { return Ok(None) };
        let settings = Identify { library, grow: false, ..self.settings.clone() };
        let done = Algorithm1::with_library_of(&settings, (self.logs, self.motion), self.progress);
        // None: a term that has no value somewhere on the smoothed path.
        let Some(done) = unless_cancelled(done)? else { return Ok(None) };
        if !self.may_explain(base.1, &done)? {
            return Ok(None);
        }
        let mut done = settings.chosen(done, self.progress)?;
        if let (_, Some(base)) = base {
            done.timings = done.timings.of(base.hold);
        }
        let mut notes = Vec::new();
        let scope = Scope::new(&settings, &done, self.progress);
        let member = scope.equations(&done.regressed, &mut notes)?;
        if !self.is_surpassed(base, &scope, (&done.regressed, member.as_ref()))? {
            return Ok(None);
        }
        let equations = member.as_ref().map_or(&done.regressed.equations, |member| &member.trial.equations);
        notes.push(grown_note(equations, &self.logs.frame.library));
        Ok(Some(Searched { settings, done, member, notes }))
    }

    /// Whether the terms of the library of `done` may explain enough of what `base` leaves: all but the noise, or so much that rollouts would
    /// be clearly nearer. To first order no choice of terms leaves less than all of them together. Only of rollouts of whole runs is known what
    /// they leave; shorter ones may hide it.
    pub(crate) fn may_explain(&self, base: Option<&Member>, done: &Algorithm1) -> Result<bool> {
        let Some(base) = base.filter(|base| base.window >= self.motion.longest_run() && base.trial.converged) else {
            return Ok(true);
        };
        let trial = &base.trial;
        let Some(equations) = trial.equations.over(&done.logs.frame) else { return Ok(true) };
        let fitter = Fitter::new(&done.logs, &done.motion, base.hold);
        let with_all = Trial { equations, ..trial.clone() };
        let Some(linear) = unless_cancelled(fitter.linearise(&with_all, base.window))? else { return Ok(true) };
        let (now, least) = linear.residuals();
        let columns = trial.counts.iter().zip(&trial.noise).zip(&self.motion.noise);
        let noise: f64 = columns.map(|((count, left), own)| count * (ON_COURSE * own / left).powi(2)).sum();
        Ok(least <= noise || ON_COURSE * ON_COURSE * least < now)
    }

    /// Whether what another library led to predicts whole runs better than `base`; or as well, and leaves nothing, and explains the logs
    /// better by odds that leave no doubt.
    pub(crate) fn is_surpassed(
        &self,
        (regressed, base): (&Regressed, Option<&Member>),
        other: &Scope<'_>,
        (grown, member): (&Regressed, Option<&Member>),
    ) -> Result<bool> {
        let compared = other.compare(other.miss_of(grown, member)?, self.miss_of(regressed, base)?);
        let (Some(base), Some(member)) = (base, member) else { return Ok(compared == Ordering::Greater) };
        let window = base.window.min(member.window);
        let at = |scope: &Scope<'_>, one: &Member| match one.window > window {
            true => scope.fitter(one.hold).fit(&one.trial.equations, window, Some(&one.trial)),
            false => Ok(one.trial.clone()),
        };
        let fits = (unless_cancelled(at(self, base))?, unless_cancelled(at(other, member))?);
        let (Some(own), Some(grown)) = fits else { return Ok(false) };
        Ok(other.fitter(member.hold).lead(&grown, &own) > GROWN
            && match compared {
                Ordering::Less => false,
                Ordering::Equal => !other.leaves_more(member, EXACT, true),
                Ordering::Greater => true,
            })
    }
}

/// The remark on equations of a larger library than `asked`.
pub(crate) fn grown_note(equations: &Equations, asked: &Library) -> Note {
    Note::Grown { terms: beyond(equations, asked) }
}

/// Names of the terms in `own` that `library` lacks.
fn beyond(own: &Equations, library: &Library) -> Vec<String> {
    let names = own.library.names();
    let mut terms: Vec<String> = own.support.iter().map(|(_, j)| names[j].to_string()).collect();
    terms.retain(|term| library.index_of(term).is_err());
    terms.sort();
    terms.dedup();
    terms
}

/// The larger library; none where nothing can be added, or it would be too large.
fn larger(settings: &Identify, data: &Dataset) -> Result<Option<LibrarySettings>> {
    let variables: Vec<&String> = settings.states.iter().chain(&settings.controls).collect();
    let mut extra = settings.library.extra.clone();
    for (c, name) in variables.iter().enumerate() {
        let values = || data.runs().iter().flat_map(|run| run.column(c).iter().copied()).filter(|v| v.is_finite());
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > POSITIVE * high {
            extra.extend([
                format!("log({name})"),
                format!("{name}*log({name})"),
                format!("sqrt({name})"),
                format!("1/{name}"),
            ]);
        } else if low < 0.0 && high > 0.0 {
            extra.extend([format!("sign({name})"), format!("{name}*abs({name})")]);
        }
    }
    for (i, a) in variables.iter().enumerate() {
        extra.push(format!("sin({a})*cos({a})"));
        for b in &variables[i + 1..] {
            let pairs = [("sin", "sin"), ("sin", "cos"), ("cos", "sin"), ("cos", "cos")];
            extra.extend(pairs.map(|(f, g)| format!("{f}({a})*{g}({b})")));
        }
    }
    let library = LibrarySettings { trig: true, extra, ..settings.library.clone() };
    let size = Library::new(&settings.states, &settings.controls, &library)?.n_terms();
    Ok((size <= MOST_GROWN).then_some(library))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Channel, Run};
    use crate::identify::result::Identification;
    use crate::identify::tests::log;
    use crate::progress::Silent;
    use faer::Mat;

    fn logged(names: &[&str], start: &[f64], rate: &dyn Fn(&[f64]) -> Vec<f64>, noise: f64) -> Dataset {
        log(names, start, &|_, x| rate(x), (0.1, 200), noise, &|_| vec![], 5)
    }

    fn found(data: &Dataset, states: &[&str], grow: bool) -> Identification {
        let states = states.iter().map(ToString::to_string).collect();
        Identify { states, grow, ..Identify::default() }.fit(data, &Silent).unwrap()
    }

    fn terms(found: &Identification) -> Vec<Vec<String>> {
        found.states.iter().map(|state| state.terms.clone()).collect()
    }

    fn further(found: &Identification) -> Option<&[String]> {
        found.notes.iter().find_map(|note| match note {
            Note::Grown { terms } => Some(&terms[..]),
            _ => None,
        })
    }

    /// Whether the terms of the larger library may explain what `terms` (with coefficients, state by state) leave of whole runs.
    fn may_explain(data: &Dataset, states: &[&str], terms: &[(&str, f64)]) -> bool {
        let states = states.iter().map(ToString::to_string).collect();
        let settings = Identify { states, smoother: None, ..Identify::default() };
        let done = Algorithm1::run(&settings, data, &Silent).unwrap();
        let mut equations = done.logs.frame.clone();
        for (s, (term, value)) in terms.iter().enumerate() {
            let place = equations.library.index_of(term).unwrap();
            let coefficients: Vec<f64> =
                (0..equations.n_terms()).map(|j| if j == place { *value } else { 0.0 }).collect();
            equations.set(s, &coefficients);
        }
        let scope = Scope::new(&settings, &done, &Silent);
        let (hold, window) = (done.timings.best.hold, done.motion.longest_run());
        let trial = scope.fitter(hold).fit(&equations, window, None).unwrap();
        let base = Member { trial, window, hold, rival: None };
        let library = larger(&settings, data).unwrap().unwrap();
        let more = Identify { library, ..settings.clone() };
        let more = Algorithm1::with_library_of(&more, (&done.logs, &done.motion), &Silent).unwrap();
        scope.may_explain(Some(&base), &more).unwrap()
    }

    #[test]
    fn what_all_terms_together_leave_is_left_by_every_choice_of_them() {
        // A wave of 20 rad/s on a decay: no terms of the state explain it.
        let wave = |i: usize, _: usize| (-0.05 * i as f64).exp() + 0.05 * (0.05 * 20.0 * i as f64).sin();
        let time = (0..200).map(|i| 0.05 * i as f64).collect();
        let run = Run { name: "wave".into(), time, values: Mat::from_fn(200, 1, wave) };
        let shaken = Dataset::new(vec![Channel::new("x")], vec![run]).unwrap();
        assert!(!may_explain(&shaken, &["x"], &[("x", -1.0)]));
        let swing = logged(&["q", "w"], &[1.0, 0.0], &|x| vec![x[1], -2.0 * x[0].sin()], 0.0);
        assert!(may_explain(&swing, &["q", "w"], &[("w", 1.0), ("q", -1.8)]));
    }

    #[test]
    fn a_pendulum_gets_its_sine_unless_only_the_terms_given_count() {
        let data = logged(&["q", "w"], &[1.9, 0.0], &|x| vec![x[1], -2.0 * x[0].sin() - 0.1 * x[1] * x[1].abs()], 0.0);
        let grown = found(&data, &["q", "w"], true);
        assert_eq!(terms(&grown), [vec!["w"], vec!["sin(q)", "w*abs(w)"]]);
        assert_eq!(further(&grown).unwrap(), ["sin(q)", "w*abs(w)"]);
        let given = found(&data, &["q", "w"], false);
        assert!(further(&given).is_none() && terms(&given)[1].iter().all(|term| !term.contains("sin")));
    }

    #[test]
    fn growth_on_a_scale_gets_its_logarithm() {
        let data = logged(&["x"], &[0.3], &|x| vec![0.4 * x[0] - 0.3 * x[0] * x[0].ln()], 0.0);
        assert_eq!(terms(&found(&data, &["x"], true)), [["x", "x*log(x)"]]);
    }

    #[test]
    fn polynomials_that_leave_only_noise_stay() {
        let rate = |x: &[f64]| vec![x[1], 1.5 * x[1] - 1.5 * x[0] * x[0] * x[1] - x[0]];
        for noise in [0.0, 0.02] {
            let data = logged(&["x", "v"], &[1.0, 0.0], &rate, noise);
            let found = found(&data, &["x", "v"], true);
            assert!(further(&found).is_none(), "{:?}", found.notes);
            assert_eq!(terms(&found), [vec!["v"], vec!["x", "v", "x^2*v"]]);
        }
    }
}
