//! The final choice of the refinement: never equations that predict whole runs worse than the initial ones, and those of a
//! smaller library if they predict better.

use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::regress::{Regressed, regress};
use crate::identify::equations::Equations;
use crate::identify::limits::{CLOSE, FORETOLD, ON_COURSE};
use crate::identify::notes::Note;
use crate::identify::result::Fidelity;
use crate::identify::support::lengthen::explodes;
use crate::identify::support::scope::{Member, Scope};
use crate::identify::support::starts::starts;
use crate::library::{Library, LibrarySettings};
use crate::refine::Hold;
use std::cmp::Ordering;

/// Mean squared error of whole-run rollouts in units of the variance; none where one diverges.
pub(crate) type Miss = Option<f64>;

impl Scope<'_> {
    /// `found`, or what predicts whole runs better; none where that is the regression itself, unrefined.
    pub(crate) fn settle(&self, found: Member, regressed: &Regressed, notes: &mut Vec<Note>) -> Result<Option<Member>> {
        let miss_of = |member: &Member| self.miss_of(regressed, Some(member));
        let before = self.miss_of(regressed, None)?;
        let is_foreseen = before.is_some_and(|miss| miss < CLOSE);
        if !is_foreseen && self.is_unforeseeable(&found)? {
            return Ok(Some(found));
        }
        let mut best = found;
        let mut miss = miss_of(&best)?;
        if foretold(before) && self.is_better(before, miss) {
            match self.with_terms_of(&regressed.equations)? {
                Some(member) if !self.is_better(before, miss_of(&member)?) => {
                    notes.push(Note::TermsKept { degree: None, unrefined: false });
                    miss = miss_of(&member)?;
                    best = member;
                }
                _ => {
                    notes.push(Note::TermsKept { degree: None, unrefined: true });
                    return Ok(None);
                }
            }
        }
        let whole = self.motion.longest_run();
        // Nothing is better than what only the noise keeps from perfection.
        let at_the_noise = !self.is_better(Some(0.0), miss);
        if at_the_noise
            || miss.is_some_and(|miss| miss < CLOSE)
            || explodes(&self.fitter(best.hold), &best.trial, best.window, whole)?
        {
            return Ok(Some(best));
        }
        for degree in 1..self.settings.library.degree {
            let Some(smaller) = self.with_degree(degree)? else { continue };
            let own = miss_of(&smaller)?;
            if foretold(own) && self.is_better(own, miss) {
                notes.retain(|note| !matches!(note, Note::TermsKept { .. }));
                notes.push(Note::TermsKept { degree: Some(degree), unrefined: false });
                (best, miss) = (smaller, own);
            }
        }
        Ok(Some(best))
    }

    /// Whether rollouts leave nothing but the noise, and yet small differences outgrow the motion within a whole run: then whole
    /// runs say nothing of equations that may well be right. What diverges is foreseen well enough.
    pub(crate) fn is_unforeseeable(&self, found: &Member) -> Result<bool> {
        let trial = &found.trial;
        let mut pairs = trial.noise.iter().zip(&self.motion.noise);
        if !pairs.all(|(left, noise)| *left <= ON_COURSE * noise) {
            return Ok(false);
        }
        let growth = self.fitter(found.hold).amplification_of(&trial.equations, self.motion.longest_run());
        Ok(unless_cancelled(growth)?.is_some_and(|growth| growth.is_finite() && growth > self.room()))
    }

    /// By how much the noise may grow before it is as large as the motion, of the state where that is least; infinite without
    /// noise.
    fn room(&self) -> f64 {
        let pairs = self.motion.spread.iter().zip(&self.motion.noise);
        pairs.map(|(spread, noise)| spread / noise).filter(|room| *room > 1.0).fold(f64::INFINITY, f64::min)
    }

    /// How far rollouts lie from the logs where they can be foretold: over whole runs, or for as long as the noise of their
    /// starts takes to outgrow the motion.
    pub(crate) fn fidelity(&self, equations: &Equations, hold: Hold) -> Result<Option<Fidelity>> {
        let fitter = self.fitter(hold);
        let mut length = self.motion.longest_run();
        let mut found = fitter.distance(equations, length)?;
        // What leaves for good is no model of the runs, however well it begins.
        if found.is_some_and(|(miss, _)| miss.is_some()) {
            let outgrown = |length: f64| -> Result<bool> {
                let growth = unless_cancelled(fitter.amplification_of(equations, length))?;
                Ok(growth.is_some_and(|growth| growth > self.room()))
            };
            let whole = length;
            while length > self.motion.shortest_window() && outgrown(length)? {
                length /= 2.0;
            }
            if length < whole {
                found = fitter.distance(equations, length)?;
            }
        }
        Ok(found.map(|(miss, still)| Fidelity { length, error: miss.map(f64::sqrt), still: still.sqrt() }))
    }

    /// How whole-run rollouts that miss the logs by `one` compare with others: greater where they are clearly nearer.
    pub(crate) fn compare(&self, one: Miss, other: Miss) -> Ordering {
        self.is_better(one, other).cmp(&self.is_better(other, one))
    }

    /// By how much whole-run rollouts miss the logs: those of a member, or of the regression where there is none.
    pub(crate) fn miss_of(&self, regressed: &Regressed, member: Option<&Member>) -> Result<Miss> {
        match member {
            Some(member) => self.miss(&member.trial.equations, member.hold),
            None => self.miss(&regressed.equations, self.timings.best.hold),
        }
    }

    fn miss(&self, equations: &Equations, hold: Hold) -> Result<Miss> {
        let found = self.fitter(hold).distance(equations, self.motion.longest_run())?;
        Ok(found.and_then(|(miss, _)| miss))
    }

    /// Whether `one` is below `other` by more than rollouts that are on course differ; what both owe to the noise counts as
    /// equal.
    fn is_better(&self, one: Miss, other: Miss) -> bool {
        let moving = || self.motion.spread.iter().zip(&self.motion.noise).filter(|(spread, _)| **spread > 0.0);
        let noise =
            moving().map(|(spread, noise)| (noise / spread).powi(2)).sum::<f64>() / moving().count().max(1) as f64;
        match (one, other) {
            (Some(one), Some(other)) => other > ON_COURSE * ON_COURSE * one.max(noise),
            (Some(_), None) => true,
            (None, _) => false,
        }
    }

    /// The same terms, their coefficients refined with rollouts that grow while they stay on course.
    fn with_terms_of(&self, equations: &Equations) -> Result<Option<Member>> {
        let hold = self.timings.best.hold;
        let (fitter, rollouts) = (self.fitter(hold), self.rollouts());
        let trial = unless_cancelled(fitter.fit(equations, rollouts.shortest(), None))?;
        let Some(trial) = trial else { return Ok(None) };
        let (trial, window) = self.stretch(&fitter, trial, rollouts)?;
        Ok(Some(Member { trial, window, hold, rival: None }))
    }

    /// What a library of terms of this degree at most leads to.
    fn with_degree(&self, degree: usize) -> Result<Option<Member>> {
        let mut frame = self.logs.frame_with(&self.timings.best.delays);
        let settings = LibrarySettings { degree, ..self.settings.library.clone() };
        let smaller = Library::new(&self.settings.states, &self.settings.controls, &settings)?;
        let (names, smaller) = (frame.library.names(), smaller.names());
        for (allowed, kept) in frame.allowed.iter_mut().zip(&frame.kept) {
            allowed.retain(|&j| smaller.contains(&names[j]) || kept.contains(&j));
        }
        if (0..frame.n_states()).any(|s| frame.fixed[s].is_none() && frame.allowed[s].is_empty()) {
            return Ok(None);
        }
        let regressed = regress(self.settings, frame, self.rows, self.progress)?;
        Ok(self.search(&starts(&regressed), self.rollouts())?.ok())
    }
}

fn foretold(miss: Miss) -> bool {
    miss.is_some_and(|miss| miss < FORETOLD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Dataset;
    use crate::identify::algorithm1::Algorithm1;
    use crate::identify::settings::Identify;
    use crate::identify::tests::log;
    use crate::progress::Silent;

    fn settings(states: &[&str]) -> Identify {
        Identify { states: states.iter().map(ToString::to_string).collect(), ..Identify::default() }
    }

    #[test]
    fn whole_runs_of_a_chaotic_motion_replace_no_equations_that_leave_only_noise() {
        // Genesio and Tesi 1992; their terms, not those of straight lines that happen to end nearer.
        let rate = |_: f64, x: &[f64]| vec![x[1], x[2], x[0] * x[0] - x[0] - 1.1 * x[1] - 0.44 * x[2]];
        for seed in 0..3 {
            let data = log(&["x", "y", "z"], &[-0.35, -0.34, 0.47], &rate, (0.0594, 1000), 0.004, &|_| vec![], seed);
            let found = settings(&["x", "y", "z"]).fit(&data, &Silent).unwrap();
            let terms: Vec<Vec<String>> = found.states.into_iter().map(|state| state.terms).collect();
            assert_eq!(terms, [vec!["y"], vec!["z"], vec!["x", "y", "z", "x^2"]], "seed {seed}");
        }
    }

    /// How much differences grow over a log under `terms` (state, term, coefficient), and how much they may.
    fn growth(settings: &Identify, data: &Dataset, terms: &[(usize, &str, f64)]) -> (f64, f64) {
        let done = Algorithm1::run(settings, data, &Silent).unwrap();
        let mut equations = done.logs.frame.clone();
        for s in 0..settings.states.len() {
            let mut coefficients = vec![0.0; equations.n_terms()];
            for (_, term, value) in terms.iter().filter(|(state, _, _)| *state == s) {
                coefficients[equations.library.index_of(term).unwrap()] = *value;
            }
            equations.set(s, &coefficients);
        }
        let scope = Scope::new(settings, &done, &Silent);
        let growth = scope.fitter(Hold::Linear).amplification_of(&equations, scope.motion.longest_run());
        (growth.unwrap(), scope.room())
    }

    #[test]
    fn bursts_that_come_again_are_unforeseeable_although_differences_are_small_between_them() {
        // Liu and Chen (dysts): differences are 7800 times as large in the last burst, and 18 times at the end of the log.
        let rate =
            |_: f64, x: &[f64]| vec![0.4 * x[0] + x[1] * x[2], -12.0 * x[1] - x[0] * x[2], -5.0 * x[2] - x[0] * x[1]];
        let data = log(&["x", "y", "z"], &[1.46, -0.03, -0.014], &rate, (0.0801, 201), 0.0, &|_| vec![], 1);
        let terms =
            [(0, "x", 0.4), (0, "y*z", 1.0), (1, "y", -12.0), (1, "x*z", -1.0), (2, "z", -5.0), (2, "x*y", -1.0)];
        let settings = Identify { smoother: None, ..settings(&["x", "y", "z"]) };
        let (growth, _) = growth(&settings, &data, &terms);
        assert!(growth > 1000.0, "{growth}");
    }

    #[test]
    fn what_grows_once_and_is_damped_after_it_is_foreseeable() {
        // A pendulum let go near its upper rest: differences grow 340 times while it falls, but it hangs in the end.
        let rate = |_: f64, x: &[f64]| vec![x[1], -x[0].sin() - 0.5 * x[1]];
        let data = log(&["q", "w"], &[3.13, 0.0], &rate, (0.05, 600), 0.05, &|_| vec![], 1);
        let library = LibrarySettings { trig: true, ..LibrarySettings::default() };
        let settings = Identify { library, ..settings(&["q", "w"]) };
        let (growth, room) = growth(&settings, &data, &[(0, "w", 1.0), (1, "sin(q)", -1.0), (1, "w", -0.5)]);
        assert!(growth < room, "{growth} {room}");
    }

    #[test]
    fn equations_that_leave_for_good_foretell_nothing_however_well_they_begin() {
        let data = log(&["x"], &[1.0], &|_, x| vec![-x[0]], (0.1, 100), 0.0, &|_| vec![], 1);
        let settings = settings(&["x"]);
        let mut done = Algorithm1::run(&settings, &data, &Silent).unwrap();
        let equations = &mut done.regressed.equations;
        let mut coefficients = vec![0.0; equations.n_terms()];
        // x' = 0.3 x^2 is infinite after 3.3 of the 9.9 s.
        coefficients[equations.library.index_of("x^2").unwrap()] = 0.3;
        equations.set(0, &coefficients);
        let scope = Scope::new(&settings, &done, &Silent);
        let fidelity = scope.fidelity(&done.regressed.equations, Hold::Zero).unwrap().unwrap();
        assert_eq!((fidelity.error, fidelity.is_poor()), (None, true));
        assert!((fidelity.length - 9.9).abs() < 1e-9, "{}", fidelity.length);
    }
}
