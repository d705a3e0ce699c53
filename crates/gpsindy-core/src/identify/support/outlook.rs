//! What the logs leave open: how the equations predict a part of them that they were not fitted to, and how differently equations
//! predict, from starts in and around what was logged, that other noise of the same size would have led to.
//!
//! Source: Efron and Tibshirani 1993, An Introduction to the Bootstrap, section 9.4 (residuals drawn anew, the choice of the terms included).

use crate::data::{Dataset, Run};
use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::made::Made;
use crate::identify::equations::Equations;
use crate::identify::limits::consensus::FOLLOWED;
use crate::identify::limits::outlook::{AROUND, LEFT_OUT, LONGEST, REMARKED, REPLICATES, STARTS};
use crate::identify::limits::{EXACT, FEWEST};
use crate::identify::notes::Note;
use crate::identify::outlook::{Doubt, LeftOut, Outlook};
use crate::identify::support::fit::{Fitter, Trial};
use crate::identify::support::linear::Linear;
use crate::identify::support::roller::{Path, Roller};
use crate::identify::support::scope::{Member, Scope};
use crate::random::{normal, uniform};
use faer::Mat;
use rand_chacha::ChaCha8Rng;
use rand_core::SeedableRng;

impl Scope<'_> {
    /// What the logs leave open, where rollouts can be foretold over `length` seconds; and remarks on it.
    pub(crate) fn outlook(
        &self,
        found: &Member,
        linear: &Linear,
        length: f64,
        notes: &mut Vec<Note>,
    ) -> Result<Outlook> {
        let left_out = self.left_out(found, length)?;
        let doubt = self.doubt(found, linear)?;
        let exchangeable = linear.exchangeable(found.trial.share, &found.trial.equations);
        if left_out.is_some_and(|part| part.is_missed() && !part.inside) {
            notes.push(Note::Beyond);
        }
        let is_said = notes.iter().any(|note| matches!(note, Note::Unpredictable { .. }));
        let is_unstable = doubt.unstable > REMARKED;
        // Where the motion is unstable, any other equations end elsewhere.
        if doubt.open > REMARKED && !is_said && !is_unstable {
            notes.push(Note::Open { share: doubt.open, exchangeable: exchangeable.clone() });
        }
        if doubt.diverging > REMARKED {
            notes.push(Note::Diverging { share: doubt.diverging });
        }
        if is_unstable && !is_said {
            notes.push(Note::Unstable { share: doubt.unstable });
        }
        Ok(Outlook { left_out, doubt, exchangeable })
    }

    /// How the terms, their coefficients fitted to the first part of every run, foretell the last part, over rollouts of `length`
    /// seconds at most; none where that part is too short.
    fn left_out(&self, found: &Member, length: f64) -> Result<Option<LeftOut>> {
        let fitter = self.fitter(found.hold);
        let runs = fitter.data.runs();
        let cuts: Vec<usize> = runs.iter().map(|run| ((1.0 - LEFT_OUT) * run.n_samples() as f64) as usize).collect();
        let is_short = |(run, &cut): (&Run, &usize)| cut < FEWEST || run.n_samples() < cut + FEWEST;
        if runs.iter().zip(&cuts).any(is_short) {
            return Ok(None);
        }
        let inside = self.is_covered(&cuts);
        let diverged = LeftOut { error: None, mean: 1.0, inside };
        let Some(trial) = self.fitted_before(&fitter, &cuts, found)? else { return Ok(Some(diverged)) };
        let moving: Vec<usize> = (0..self.motion.spread.len()).filter(|&s| self.motion.spread[s] > 0.0).collect();
        let (mut missed, mut moved, mut count) = (0.0, 0.0, 0.0);
        for (k, (run, &cut)) in runs.iter().zip(&cuts).enumerate() {
            let roller = Roller::new(self.motion, &trial.equations, found.hold)?;
            let track = &self.motion.tracks[k];
            let mean = |s: usize| {
                let there = || run.column(s)[cut..].iter().filter(|v| v.is_finite());
                there().sum::<f64>() / there().count().max(1) as f64
            };
            let means: Vec<f64> = moving.iter().map(|&s| mean(s)).collect();
            let mut first = cut;
            while first + 1 < run.n_samples() {
                let after = run.time.partition_point(|&t| t <= run.time[first] + length).max(first + 2);
                let initial: Vec<f64> = (0..self.motion.spread.len()).map(|s| track.mean[(first, s)]).collect();
                let Some(path) = roller.path(k, first..after, &initial)? else { return Ok(Some(diverged)) };
                for (&s, mean) in moving.iter().zip(&means) {
                    let there = (first..after).filter(|&i| run.values[(i, s)].is_finite());
                    for i in there {
                        missed += ((run.values[(i, s)] - path[(i - first, s)]) / self.motion.spread[s]).powi(2);
                        moved += ((run.values[(i, s)] - mean) / self.motion.spread[s]).powi(2);
                        count += 1.0;
                    }
                }
                first = after;
            }
        }
        let size = |sum: f64| (sum / count).sqrt();
        Ok((count > 0.0).then(|| LeftOut { error: Some(size(missed)), mean: size(moved), inside }))
    }

    /// Whether no smoothed state leaves, behind `cuts` (one a run), the range before them.
    fn is_covered(&self, cuts: &[usize]) -> bool {
        let range = |s: usize, part: &dyn Fn(usize, usize) -> std::ops::Range<usize>| {
            let tracks = self.motion.tracks.iter().zip(cuts);
            let values = tracks.flat_map(|(track, &cut)| &track.mean.col_as_slice(s)[part(cut, track.n_samples())]);
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
        };
        (0..self.motion.spread.len()).all(|s| {
            let (before, behind) = (range(s, &|cut, _| 0..cut), range(s, &|cut, end| cut..end));
            let margin = FOLLOWED * (before.1 - before.0);
            behind.0 >= before.0 - margin && behind.1 <= before.1 + margin
        })
    }

    /// The same terms fitted to the samples before `cuts`, one a run; none where that fails.
    fn fitted_before(&self, fitter: &Fitter<'_>, cuts: &[usize], found: &Member) -> Result<Option<Trial>> {
        let runs = fitter.data.runs().iter().zip(cuts).map(|(run, &cut)| Run {
            name: run.name.clone(),
            time: run.time[..cut].to_vec(),
            values: run.values.subrows(0, cut).to_owned(),
        });
        let data = Dataset::new(fitter.data.channels().to_vec(), runs.collect())?;
        let longest = data.runs().iter().map(|run| run.time[run.n_samples() - 1] - run.time[0]).fold(0.0, f64::max);
        let made = Made::default();
        let first = Fitter { data: &data, noise: fitter.noise.clone(), made: &made, ..*fitter };
        unless_cancelled(first.fit(&found.trial.equations, found.window.min(longest), Some(&found.trial)))
    }

    /// How far rollouts from starts in and around what was logged can be relied on.
    fn doubt(&self, found: &Member, linear: &Linear) -> Result<Doubt> {
        let own = &found.trial;
        let mut rng = ChaCha8Rng::seed_from_u64(self.settings.seed);
        let starts: Vec<Vec<f64>> = self.starts_around(&mut rng);
        let roller = |equations: &Equations| Roller::new(self.motion, equations, found.hold);
        let (Some(run), first) = (self.longest_track(), roller(&own.equations)?) else { return Ok(Doubt::default()) };
        let range = 0..self.motion.tracks[run].n_samples().min(LONGEST);
        let roll = |roller: &Roller<'_>, start: &Vec<f64>| roller.path(run, range.clone(), start);
        let paths = starts.iter().map(|start| roll(&first, start)).collect::<Result<Vec<_>>>()?;
        let known = paths.iter().filter(|path| path.is_some()).count() as f64;
        let all = paths.len() as f64;
        let mut doubt = Doubt { diverging: (all - known) / all, ..Doubt::default() };
        let scale = 1.0 / own.share.sqrt();
        for _ in 0..REPLICATES {
            self.keep_going()?;
            let (support, coefficients) = linear.redrawn(|| scale * normal(&mut rng));
            let mut equations = own.equations.clone();
            equations.set_support(&support, &coefficients);
            let other = roller(&equations)?;
            for (path, start) in paths.iter().zip(&starts).filter(|(path, _)| path.is_some()) {
                let is_worse = self.is_worse_than_the_mean(path, &roll(&other, start)?);
                doubt.open += if is_worse { 1.0 / (known * REPLICATES as f64) } else { 0.0 };
            }
        }
        for (path, start) in paths.iter().zip(&starts).filter(|(path, _)| path.is_some()) {
            let sizes = own.noise.iter().zip(&self.motion.spread);
            let near =
                start.iter().zip(sizes).map(|(v, (noise, spread))| v + noise.max(EXACT * spread) * normal(&mut rng));
            let near = roll(&first, &near.collect())?;
            doubt.unstable += if self.is_worse_than_the_mean(path, &near) { 1.0 / known } else { 0.0 };
        }
        Ok(doubt)
    }

    fn longest_track(&self) -> Option<usize> {
        (0..self.motion.tracks.len()).max_by_key(|&k| self.motion.tracks[k].n_samples())
    }

    /// States in and around what the logs visited.
    fn starts_around(&self, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let range = |s: usize| {
            let values = self.motion.tracks.iter().flat_map(|track| track.mean.col_as_slice(s).iter().copied());
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
            let reach = AROUND * (high - low);
            // A level or a count keeps its sign.
            let from = if low >= 0.0 { (low - reach).max(0.0) } else { low - reach };
            let to = if high <= 0.0 { (high + reach).min(0.0) } else { high + reach };
            (from, to)
        };
        let ranges: Vec<(f64, f64)> = (0..self.motion.spread.len()).map(range).collect();
        let mut start = || ranges.iter().map(|(from, to)| from + (to - from) * uniform(rng)).collect();
        (0..STARTS).map(|_| start()).collect()
    }

    /// Whether `own` predicts `truth` worse than the mean of `truth` does; what diverges is no truth.
    fn is_worse_than_the_mean(&self, own: &Path, truth: &Path) -> bool {
        let (Some(own), Some(truth)) = (own, truth) else { return false };
        let (mut missed, mut moved) = (0.0, 0.0);
        let square = |own: f64, other: f64, size: f64| ((own - other) / size).powi(2);
        for (s, &size) in self.motion.spread.iter().enumerate().filter(|(_, size)| **size > 0.0) {
            let mean = column_mean(truth, s);
            for i in 0..truth.nrows() {
                missed += square(own[(i, s)], truth[(i, s)], size);
                moved += square(truth[(i, s)], mean, size) + FOLLOWED * FOLLOWED;
            }
        }
        missed > moved
    }
}

fn column_mean(values: &Mat<f64>, column: usize) -> f64 {
    values.col_as_slice(column).iter().sum::<f64>() / values.nrows() as f64
}

#[cfg(test)]
mod tests {
    use crate::data::Dataset;
    use crate::identify::notes::Note;
    use crate::identify::result::Identification;
    use crate::identify::settings::Identify;
    use crate::identify::tests::log;
    use crate::library::LibrarySettings;
    use crate::progress::Silent;

    fn found(data: &Dataset, states: &[&str], degree: usize) -> Identification {
        let library = LibrarySettings { degree, ..LibrarySettings::default() };
        let states = states.iter().map(ToString::to_string).collect();
        Identify { states, library, ..Identify::default() }.fit(data, &Silent).unwrap()
    }

    #[test]
    fn a_log_of_growth_near_its_end_leaves_open_how_it_begins() {
        // 1.8 x - 0.11 x^2, seen from 11 to 16 only: a straight line explains that as well.
        let rate = |_: f64, x: &[f64]| vec![1.8 * x[0] - 0.11 * x[0] * x[0]];
        let short = log(&["x"], &[11.0], &rate, (0.05, 100), 0.5, &|_| vec![], 1);
        let open = found(&short, &["x"], 3).outlook.unwrap();
        assert!(!open.exchangeable.is_empty(), "{open:?}");
        // From near 0 on there is no doubt.
        let long = log(&["x"], &[0.1], &rate, (0.05, 100), 0.1, &|_| vec![], 1);
        let clear = found(&long, &["x"], 3).outlook.unwrap();
        assert!(clear.exchangeable.is_empty() && clear.doubt.open < 0.05, "{clear:?}");
    }

    #[test]
    fn equations_that_are_known_well_leave_nothing_open() {
        let rate = |_: f64, x: &[f64]| vec![1.1 * x[0] - 0.4 * x[0] * x[1], -x[1] + 0.4 * x[0] * x[1]];
        for seed in 0..3 {
            let data = log(&["a", "b"], &[5.0, 3.0], &rate, (0.1, 120), 0.05, &|_| vec![], seed);
            let found = found(&data, &["a", "b"], 2);
            assert!(found.notes.is_empty() && !found.is_poor(), "{:?}", found.notes);
            let part = found.left_out().unwrap();
            assert!(part.error.unwrap() < 0.2 * part.mean, "{part:?}");
        }
    }

    #[test]
    fn of_a_chaotic_motion_it_is_said_that_it_is_unstable_and_not_that_other_equations_explain_it() {
        let rate =
            |_: f64, x: &[f64]| vec![10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]];
        let data = log(&["x", "y", "z"], &[1.0, 2.0, 20.0], &rate, (0.02, 500), 0.1, &|_| vec![], 1);
        let notes = found(&data, &["x", "y", "z"], 2).notes;
        assert!(notes.iter().any(|n| matches!(n, Note::Unstable { .. } | Note::Unpredictable { .. })), "{notes:?}");
        assert!(!notes.iter().any(|n| matches!(n, Note::Open { .. })), "{notes:?}");
    }

    #[test]
    fn a_polynomial_of_an_angle_that_winds_on_does_not_foretell_the_end_of_its_log() {
        let rate = |_: f64, x: &[f64]| vec![x[1], 1.7 - x[0].sin() - 0.6 * x[1]];
        let data = log(&["q", "w"], &[1.5, -0.2], &rate, (0.1, 100), 0.05, &|_| vec![], 1);
        let library = LibrarySettings::default();
        let states = vec!["q".into(), "w".into()];
        let found = Identify { states, library, grow: false, ..Identify::default() }.fit(&data, &Silent).unwrap();
        let part = found.left_out().unwrap();
        assert!(part.is_missed() && !part.inside && found.notes.contains(&Note::Beyond), "{:?}", found.outlook);
    }
}
