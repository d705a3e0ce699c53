//! An account of the logs: a contestant beside random processes, and how well the logs speak of both.

use crate::diagnose::catalogue::rival::{self, Rival};
use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::fit::filter::{Acts, Course, Filter, Filtered, Linear, Pace, Process};
use crate::diagnose::fit::linear::functions::courses;
use crate::diagnose::limits::forcing::{
    CHANGES, CLIMBED, CURVED, LAWFUL, MOST_PATHS, MOST_READINGS, SETTLED, SKETCHED_READINGS,
};
use crate::diagnose::limits::weigh::TWINS;
use crate::diagnose::limits::{CONVINCING, IN_SIGHT};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::forcing::climb::{Climb, Range, range};
use crate::diagnose::steps::findings::{Forcing, StatedProcess};
use crate::error::Result;
use crate::parallel;
use crate::refine::{Window, prior_cost};
use nalgebra::Matrix2;

/// A contestant beside random processes, and how well the logs speak of both.
#[derive(Clone)]
pub(super) struct Account {
    pub(super) fit: Contestant,
    filter: Filter,
    pub(super) processes: Vec<Process>,
    pub(super) score: f64,
    /// Samples of the logs that are looked at.
    most: usize,
}

impl Account {
    /// `fit` with `processes` as they are; nothing where it can't be filtered.
    pub(super) fn of(contest: &Contest<'_>, fit: &Contestant, processes: &[Process]) -> Result<Option<Self>> {
        let bare = Self::bare(contest, fit, processes.iter().map(|p| p.acts), whole_stretches(fit))?;
        Ok(bare.and_then(|bare| Self { processes: processes.to_vec(), ..bare }.charged()))
    }

    /// `fit` beside processes at `places` that are still to be found; nothing where it can't be filtered.
    fn bare(
        contest: &Contest<'_>,
        fit: &Contestant,
        places: impl Iterator<Item = Acts>,
        most: usize,
    ) -> Result<Option<Self>> {
        let of = |filter| Self { fit: fit.clone(), filter, processes: Vec::new(), score: contest.prior(fit), most };
        Ok(Filter::new(&fit.system, places)?.map(of))
    }

    /// `fit` with coloured noise on its columns, where that convinces.
    pub(super) fn unforced(contest: &Contest<'_>, fit: &Contestant) -> Result<Option<Self>> {
        Self::coloured(contest, fit, whole_stretches(fit))
    }

    /// The same on so many samples.
    fn coloured(contest: &Contest<'_>, fit: &Contestant, most: usize) -> Result<Option<Self>> {
        let bare = Self::bare(contest, fit, std::iter::empty(), most)?.and_then(Self::charged);
        bare.map(|bare| bare.grown(contest, &columns(fit))).transpose()
    }

    /// `fit` with random forces in its rows and coloured noise on its columns, where they convince; nothing where no filter takes it, nor where
    /// a part of the logs shows already that what they leave follows a law.
    pub(super) fn forced(contest: &Contest<'_>, fit: &Contestant) -> Result<Option<Self>> {
        Self::in_part(contest, fit)?.map_or(Ok(None), |part| part.on_all(contest))
    }

    /// What was found on a part of the readings, on all of them; nothing where a law shows on the part.
    pub(super) fn on_all(self, contest: &Contest<'_>) -> Result<Option<Self>> {
        if self.shows_laws(contest) && self.functions(contest)? < LAWFUL {
            return Ok(None);
        }
        let (fit, places) = (self.fit.clone(), places(&self.fit));
        let whole = Self { most: whole_stretches(&fit), ..self };
        let whole = match whole.linear(&whole.processes) {
            Some(linear) if !whole.processes.is_empty() => {
                let ranges = whole.processes.iter().map(|p| range(contest, &fit, p.acts)).collect();
                let start = whole.processes.clone();
                let bare = Self { score: contest.prior(&fit), ..whole };
                Sketch { account: bare, climb: Climb { ranges, linear }, start, cost: f64::NAN }.finished()
            }
            _ => whole.charged_anew(contest),
        };
        whole.map(|whole| whole.grown(contest, &places)).transpose()
    }

    /// Whether its forces change often enough on the samples that are looked at: a slow one runs beside some function by chance.
    fn shows_laws(&self, contest: &Contest<'_>) -> bool {
        let lasts = self.most as f64 * contest.scene.period;
        self.processes.iter().filter(|process| process.row().is_some()).all(|force| lasts > CHANGES * force.time)
    }

    /// As [`Self::forced`], the one of some other fits of which the same readings speak best beside the same processes; nothing where none convinces,
    /// nor where they speak far better of a `rival`, which leaves a law.
    pub(super) fn of_one_near(&self, contest: &Contest<'_>, near: &[Contestant], rival: f64) -> Result<Option<Self>> {
        let is_open = |better: &Self| better.score > self.score + CONVINCING && better.score > rival - IN_SIGHT;
        let better = self.best_of(contest, near).filter(is_open);
        better.map_or(Ok(None), |better| Self::forced(contest, &better.fit))
    }

    /// `fit` with random processes where they convince on a part of the readings.
    pub(super) fn in_part(contest: &Contest<'_>, fit: &Contestant) -> Result<Option<Self>> {
        let Some(whole) = Self::of(contest, &fit.believed(), &[])? else { return Ok(None) };
        let part = Self { most: most(fit, SKETCHED_READINGS), ..whole };
        part.charged_anew(contest).map(|part| part.grown(contest, &places(fit))).transpose()
    }

    /// The same processes beside another fit, its parameters moved, on the same readings; nothing where no filter takes it.
    pub(super) fn beside(&self, contest: &Contest<'_>, fit: &Contestant) -> Option<Self> {
        let acts = self.processes.iter().map(|p| p.acts);
        let bare = Self::bare(contest, fit, acts, self.most).ok()??;
        let mut beside = Self { processes: self.processes.clone(), ..bare };
        beside.tune()?;
        beside.charged()
    }

    /// The same processes beside that one of some fits of which the readings speak best.
    fn best_of(&self, contest: &Contest<'_>, fits: &[Contestant]) -> Option<Self> {
        let accounts: Vec<Self> = parallel::map(fits, |fit| self.beside(contest, fit)).into_iter().flatten().collect();
        accounts.into_iter().max_by(|a, b| a.score.total_cmp(&b.score))
    }

    /// Those of some fits that the logs do not distinguish from its own, given its processes: odds as of twins.
    pub(super) fn twins<'f>(&self, contest: &Contest<'_>, fits: &[&'f Contestant]) -> Vec<&'f Contestant> {
        let is_twin = |fit: &&Contestant| {
            self.beside(contest, fit).is_some_and(|other| 2.0 * (self.score - other.score).abs() < TWINS)
        };
        let found = parallel::map(fits, is_twin);
        fits.iter().zip(found).filter_map(|(fit, is_twin)| is_twin.then_some(*fit)).collect()
    }

    /// With random processes at some of `places` besides, the best first, while they convince.
    fn grown(mut self, contest: &Contest<'_>, places: &[Acts]) -> Result<Self> {
        while self.processes.len() < places.len() {
            let mut sketches = Vec::new();
            for &acts in places.iter().filter(|&&acts| self.processes.iter().all(|p| p.acts != acts)) {
                sketches.extend(self.sketched(contest, acts)?);
            }
            sketches.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            let tops = sketches.into_iter().take(CLIMBED).filter_map(Sketch::climbed);
            let top = tops.min_by(|a, b| a.cost.total_cmp(&b.cost)).and_then(Sketch::finished);
            match top {
                Some(next) if next.score > self.score + CONVINCING => self = next,
                _ => break,
            }
        }
        Ok(self)
    }

    /// Whether a force is among its processes.
    pub(super) fn is_forced(&self) -> bool {
        self.processes.iter().any(|process| process.row().is_some())
    }

    /// The columns that have coloured noise.
    pub(super) fn columns(&self) -> Vec<usize> {
        let column = |process: &Process| match process.acts {
            Acts::Column(column) => Some(column),
            Acts::Row(_) => None,
        };
        self.processes.iter().filter_map(column).collect()
    }

    /// By how much the same readings speak more of it than of its fit with coloured noise on the columns alone; nothing where no filter takes that.
    pub(super) fn lead_over_sensors(&self, contest: &Contest<'_>) -> Result<Option<f64>> {
        let plain = Self::coloured(contest, &self.fit, self.most)?;
        Ok(plain.map(|plain| self.score - plain.score))
    }

    /// Whether all of its forces were seen to be random: one whose correlation time grows to the longest may be any function of the motion.
    pub(super) fn is_seen(&self, contest: &Contest<'_>) -> bool {
        let ends = |p: &Process| p.row().is_some() && range(contest, &self.fit, p.acts).ends_at(p);
        !self.processes.iter().any(ends)
    }

    /// The same with one more random process, about where it is at its best.
    fn sketched(&self, contest: &Contest<'_>, acts: Acts) -> Result<Option<Sketch>> {
        let places: Vec<Acts> = self.processes.iter().map(|p| p.acts).chain([acts]).collect();
        let bare = Self::bare(contest, &self.fit, places.iter().copied(), self.most)?;
        let Some(account) = bare else { return Ok(None) };
        let ranges: Vec<Range> = places.into_iter().map(|acts| range(contest, &self.fit, acts)).collect();
        let start = |process: Process| self.processes.iter().copied().chain([process]).collect();
        let starts: Vec<Vec<Process>> = ranges[ranges.len() - 1].starts().map(start).collect();
        // A strong process follows the logs.
        let Some(linear) = starts.iter().rev().find_map(|start| account.linear(start)) else { return Ok(None) };
        let climb = Climb { ranges, linear };
        let costs = climb.costs_of(&starts, account.sketched_samples());
        let best = starts.into_iter().zip(costs).min_by(|a, b| a.1.total_cmp(&b.1));
        Ok(best.map(|(start, cost)| Sketch { account, climb, start, cost }))
    }

    /// The samples of a sketch.
    fn sketched_samples(&self) -> usize {
        most(&self.fit, SKETCHED_READINGS)
    }

    fn linear(&self, processes: &[Process]) -> Option<Linear> {
        let refined = &self.fit.refined;
        self.filter.linear((&self.fit.experiment, self.most), (&refined.parameters, &refined.initial), processes)
    }

    fn filtered(&self, processes: &[Process], pace: Pace) -> Option<Filtered> {
        self.filtered_with(&self.fit.refined.parameters, processes, pace)
    }

    /// The same with other parameters of the machine.
    pub(super) fn filtered_with(&self, parameters: &[f64], processes: &[Process], pace: Pace) -> Option<Filtered> {
        self.filtered_by(&self.filter, parameters, processes, pace)
    }

    /// The same by the filter of another machine.
    pub(super) fn filtered_by(
        &self,
        filter: &Filter,
        parameters: &[f64],
        processes: &[Process],
        pace: Pace,
    ) -> Option<Filtered> {
        let Contestant { experiment, refined, .. } = &self.fit;
        filter.run((experiment, self.most), (parameters, &refined.initial), processes, pace)
    }

    /// The same with the score on the samples that are looked at now.
    fn charged_anew(self, contest: &Contest<'_>) -> Option<Self> {
        Self { score: contest.prior(&self.fit), ..self }.charged()
    }

    /// With the likelihood and the beliefs in its score, less half the logarithm of the sample size for every parameter; nothing where the filter
    /// diverges.
    fn charged(mut self) -> Option<Self> {
        let found = self.filtered(&self.processes, Pace::Likelihood)?;
        self.score -= 0.5 * prior_cost(&self.fit.refined.parameters, &self.fit.free);
        let parameters = self.fit.evidence.complexity() + 2 * self.processes.len();
        self.score += found.likelihood - 0.5 * parameters as f64 * (found.count.max(2) as f64).ln();
        Some(self)
    }

    /// The processes in their own units, with what the curvature of the likelihood says of them; `p_value` of what is left.
    ///
    /// The filter knows deviations beside that of the sensors' noise, whose own size is found last.
    pub(super) fn stated(&self, p_value: f64) -> Forcing {
        let one = |place: usize| {
            let process = &self.processes[place];
            let at = |a: f64, b: f64| {
                let mut processes = self.processes.clone();
                processes[place].deviation *= (a * CURVED).exp();
                processes[place].time *= (b * CURVED).exp();
                self.filtered(&processes, Pace::Likelihood)
            };
            let centre = at(0.0, 0.0)?;
            let sides = [at(1.0, 0.0)?, at(-1.0, 0.0)?, at(0.0, 1.0)?, at(0.0, -1.0)?];
            let corners = [at(1.0, 1.0)?, at(-1.0, -1.0)?, at(1.0, -1.0)?, at(-1.0, 1.0)?];
            let second = |plus: &Filtered, minus: &Filtered| {
                -(plus.likelihood + minus.likelihood - 2.0 * centre.likelihood) / (CURVED * CURVED)
            };
            let mixed =
                -(corners[0].likelihood + corners[1].likelihood - corners[2].likelihood - corners[3].likelihood)
                    / (2.0 * CURVED).powi(2);
            let information = Matrix2::new(second(&sides[0], &sides[1]), mixed, mixed, second(&sides[2], &sides[3]));
            // The logarithm of the noise's deviation moves with both, and has an error of its own.
            let moved = |plus: &Filtered, minus: &Filtered| 0.5 * (plus.level / minus.level).ln() / (2.0 * CURVED);
            let own = Matrix2::new(1.0 + moved(&sides[0], &sides[1]), moved(&sides[2], &sides[3]), 0.0, 1.0);
            let level = Matrix2::new(0.5 / centre.count.max(1) as f64, 0.0, 0.0, 0.0);
            let covariance = information.cholesky().map(|c| own * c.inverse() * own.transpose() + level);
            let covariance =
                covariance.map_or([[f64::NAN; 2]; 2], |c| [[c[(0, 0)], c[(0, 1)]], [c[(1, 0)], c[(1, 1)]]]);
            let deviation = process.deviation * centre.level.sqrt();
            let state = match process.acts {
                Acts::Row(row) => row,
                Acts::Column(column) => self.fit.experiment.columns[column],
            };
            Some(StatedProcess { state, deviation, time: process.time, covariance })
        };
        let (forces, errors): (Vec<_>, Vec<_>) =
            (0..self.processes.len()).partition(|&place| self.processes[place].row().is_some());
        let of = |places: Vec<usize>| places.into_iter().filter_map(one).collect();
        Forcing { forces: of(forces), errors: of(errors), p_value }
    }

    /// Chance that noise gives the best function without a name, in a row or in what a column reads, as large a gain.
    pub(super) fn functions(&self, contest: &Contest<'_>) -> Result<f64> {
        Ok(self.law(contest)?.0)
    }

    /// The same, and which of the contest's functions is the best in the rows that its forces push.
    pub(super) fn law(&self, contest: &Contest<'_>) -> Result<(f64, Option<usize>)> {
        let Some(found) = self.filtered(&self.processes, Pace::Samples) else { return Ok((0.0, None)) };
        let experiment = &self.fit.experiment;
        let of_columns = rival::of_columns(self.fit.system.model(), &contest.scene, &experiment.columns);
        let along_positions = rival::along_positions(self.fit.system.model(), &contest.scene);
        let in_rows = contest.rivals.iter().chain(&along_positions).map(|r| (Acts::Row(r.state), r));
        let on_columns = of_columns.iter().filter_map(|r| Some((Acts::Column(experiment.column_of(r.state)?), r)));
        let all: Vec<(Acts, &Rival)> = in_rows.chain(on_columns).collect();
        let spent = self.fit.evidence.spent() + 2 * self.processes.len();
        let chance = |(acts, rival): &(Acts, &Rival)| -> Result<f64> {
            let along: Vec<Course> = courses(rival, *acts, &self.fit, &found)?;
            let (gain, degrees) = found.gain(*acts, &along);
            Ok(gain_tail(with_fitted_level(gain, found.count), degrees, found.count, spent))
        };
        let chances = parallel::try_map(&all, chance)?;
        let is_pushed = |&place: &usize| self.processes.iter().any(|p| p.row() == Some(contest.rivals[place].state));
        let best = (0..contest.rivals.len()).filter(is_pushed).min_by(|&a, &b| chances[a].total_cmp(&chances[b]));
        Ok((Searches::of(chances.len()).pay(chances.into_iter().fold(1.0, f64::min)), best))
    }
}

/// How many samples hold so many readings.
fn most(fit: &Contestant, readings: usize) -> usize {
    readings.div_ceil(fit.experiment.columns.len().max(1))
}

/// How many samples the stretches have that hold [`MOST_READINGS`]: what a function does late in a log shows only there.
fn whole_stretches(fit: &Contestant) -> usize {
    let most = most(fit, MOST_READINGS);
    let (mut count, mut before): (usize, Option<Window>) = (0, None);
    for window in &fit.experiment.windows {
        let goes_on = before.is_some_and(|last| last.log == window.log && last.last + 1 == window.first);
        if count > most && !goes_on {
            break;
        }
        count += window.last + 1 - window.first;
        before = Some(*window);
    }
    count
}

/// The rows that random forces may push, and the columns that may have coloured noise.
fn places(fit: &Contestant) -> Vec<Acts> {
    let model = fit.system.model();
    let rows = (0..fit.nominal_states()).filter(|&j| !model.is_kinematic(j)).map(Acts::Row);
    rows.chain(columns(fit)).collect()
}

/// The columns that may have coloured noise.
fn columns(fit: &Contestant) -> Vec<Acts> {
    (0..fit.experiment.columns.len()).map(Acts::Column).collect()
}

/// Random processes about where they are at their best.
struct Sketch {
    /// Without its processes.
    account: Account,
    climb: Climb,
    start: Vec<Process>,
    cost: f64,
}

impl Sketch {
    /// With all of its processes at their best on a part of the samples: the first of two bore what both do, so all of them move.
    fn climbed(self) -> Option<Self> {
        let most = self.account.sketched_samples();
        let start = self.climb.top(&self.start, most)?;
        let cost = self.climb.cost_of(&start, most);
        Some(Self { start, cost, ..self })
    }

    /// The account with all of its processes, and the parameters of the machine beside them, at their best.
    fn finished(self) -> Option<Account> {
        let Self { account, mut climb, start, .. } = self;
        let mut account = Account { processes: start, ..account };
        for _ in 0..MOST_PATHS {
            climb.linear = account.linear(&account.processes)?;
            let before = climb.cost_of(&account.processes, usize::MAX);
            // A path along which the filter just holds shows no way up.
            if !before.is_finite() {
                return None;
            }
            account.processes = climb.top(&account.processes, usize::MAX)?;
            let gained = before - climb.cost_of(&account.processes, usize::MAX);
            if gained + account.tune()? < SETTLED {
                break;
            }
        }
        account.charged()
    }
}
