//! Forcing: whether random forces in some rows, and no function, are what is left.
//!
//! Gusts, a road or turbulence push a machine without a law. An extended Kalman filter tells the likelihood of the logs with such a
//! force; if then no function of the states, the controls or the time improves it, what is left is random. The causes that were
//! found without it are asked again, because they may imitate it.

use crate::diagnose::catalogue::rival::{self, Rival};
use crate::diagnose::fit::contestant::{Contestant, Searches};
use crate::diagnose::fit::evidence::{gain_tail, with_fitted_level};
use crate::diagnose::fit::filter::{Acts, Course, Filter, Filtered, Force};
use crate::diagnose::fit::functions::courses;
use crate::diagnose::limits::forcing::{DURATIONS, LEVELS, LONGEST, STEPS, UNSEEN};
use crate::diagnose::limits::weigh::LIKELY;
use crate::diagnose::limits::{CHANCE, CONVINCING};
use crate::diagnose::steps::contest::Contest;
use crate::diagnose::steps::findings::{Forcing, Judged, Told};
use crate::error::Result;
use crate::parallel::*;
use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;

/// The verdict with random forces, where they are a better account of the logs than what was found without them.
///
/// `missed`: how surely held-out logs are missed without them; asked where nothing else says that something is left.
pub(crate) fn forced(
    contest: &Contest<'_>,
    mut judged: Judged,
    missed: impl FnOnce(&Judged) -> Result<f64>,
) -> Result<Judged> {
    let was_asked = std::mem::replace(&mut judged.was_asked_for_forces, true);
    let is_moot = was_asked || !judged.detected.gap || !contest.random || !Filter::takes(&judged.nominal.system);
    if is_moot || contest.run.is_out_of_time() {
        return Ok(judged);
    }
    let outcome = &judged.outcome;
    let is_left = outcome.best.hypotheses.is_empty() || outcome.left.as_ref().is_some_and(|l| l.p_value < CHANCE);
    if !is_left && missed(&judged)? <= LIKELY {
        return Ok(judged);
    }
    let stage = contest.run.stage("random forces", 3)?;
    let bare =
        |fit: &Contestant| -> Result<Option<f64>> { Ok(Account::of(contest, fit, &[])?.map(|account| account.score)) };
    // A winner that no filter takes has a sensor that reads late, whose delay shows as a function of the rates.
    let Some(plain) = bare(&judged.outcome.best)?.or(bare(&judged.nominal)?) else { return Ok(judged) };
    let Some(mut found) = at_random(contest, &judged.nominal)? else { return Ok(judged) };
    stage.advance()?;
    if !judged.outcome.best.hypotheses.is_empty()
        && let Some(beside) = beside_causes(contest, &judged)?
        && beside.score > found.score
    {
        found = beside;
    }
    stage.advance()?;
    if found.forces.is_empty() || found.score < plain + CONVINCING {
        return Ok(judged);
    }
    let p_value = found.functions(contest)?;
    stage.advance()?;
    let forcing = Forcing { told: found.told(), p_value };
    if forcing.probability() < LIKELY {
        return Ok(judged);
    }
    Ok(replaced(judged, found.fit, forcing))
}

/// The verdict with `fit` in the place of the winner, and random forces.
fn replaced(mut judged: Judged, fit: Contestant, forcing: Forcing) -> Judged {
    let outcome = &mut judged.outcome;
    outcome.left = None;
    if !fit.has_effects_of(&outcome.best) {
        let place = |h: &_| outcome.best.hypotheses.iter().position(|known| known == h);
        outcome.removed = fit.hypotheses.iter().map(|h| place(h).map_or(0.0, |i| outcome.removed[i])).collect();
        outcome.alternatives = vec![vec![fit.clone()]; fit.hypotheses.len()];
    }
    outcome.best = fit;
    if outcome.best.hypotheses.is_empty() {
        // The nominal model, its sensors and random forces explain the logs.
        judged.detected.gap = false;
        judged.detected.p_value = forcing.p_value;
    }
    judged.forcing = Some(forcing);
    judged
}

/// The nominal model with random forces, row after row while they convince.
fn at_random(contest: &Contest<'_>, fit: &Contestant) -> Result<Option<Account>> {
    let Some(mut best) = Account::of(contest, fit, &[])? else { return Ok(None) };
    let model = fit.system.model();
    let rows: Vec<usize> = (0..fit.nominal_states()).filter(|&j| !model.is_kinematic(j)).collect();
    while best.forces.len() < rows.len() {
        let mut next: Option<Account> = None;
        for &row in rows.iter().filter(|&&row| best.forces.iter().all(|f| f.row != row)) {
            let with = best.with(contest, row)?;
            if with.as_ref().is_some_and(|with| next.as_ref().is_none_or(|next| with.score > next.score)) {
                next = with;
            }
        }
        match next {
            Some(next) if next.score > best.score + CONVINCING => best = next,
            _ => break,
        }
    }
    Ok(Some(best))
}

/// The winner with random forces, without those of its effects that do not convince beside them.
fn beside_causes(contest: &Contest<'_>, judged: &Judged) -> Result<Option<Account>> {
    let Some(mut best) = at_random(contest, &judged.outcome.best)? else { return Ok(None) };
    while best.fit.hypotheses.len() > 1 && !contest.run.is_out_of_time() {
        let mut simpler: Option<Account> = None;
        for place in 0..best.fit.hypotheses.len() {
            let Some(fit) = contest.without(&judged.nominal, &best.fit, &[place])? else { continue };
            let Some(account) = Account::of(contest, &fit, &best.forces)? else { continue };
            if simpler.as_ref().is_none_or(|known| account.score > known.score) {
                simpler = Some(account);
            }
        }
        match simpler {
            Some(simpler) if simpler.score > best.score - CONVINCING => best = simpler,
            _ => break,
        }
    }
    Ok(Some(best))
}

/// A contestant with random forces, and how well the logs speak of both.
struct Account {
    fit: Contestant,
    filter: Filter,
    forces: Vec<Force>,
    score: f64,
}

impl Account {
    /// `fit` with `forces` as they are; nothing where it can't be filtered.
    fn of(contest: &Contest<'_>, fit: &Contestant, forces: &[Force]) -> Result<Option<Self>> {
        let rows: Vec<usize> = forces.iter().map(|f| f.row).collect();
        let Some(filter) = Filter::new(&fit.system, &rows)? else { return Ok(None) };
        let mut account = Self { fit: fit.clone(), filter, forces: forces.to_vec(), score: contest.prior(fit) };
        let Some(found) = account.filtered(&account.forces, false) else { return Ok(None) };
        account.charge(&found);
        Ok(Some(account))
    }

    /// The same with one more random force, in the row where it is at its best.
    fn with(&self, contest: &Contest<'_>, row: usize) -> Result<Option<Self>> {
        let rows: Vec<usize> = self.forces.iter().map(|f| f.row).chain([row]).collect();
        let Some(filter) = Filter::new(&self.fit.system, &rows)? else { return Ok(None) };
        let mut account =
            Self { fit: self.fit.clone(), filter, forces: self.forces.clone(), score: contest.prior(&self.fit) };
        let scene = &contest.scene;
        let logs = &self.fit.experiment.logs;
        let together: f64 = logs.iter().map(|log| log.time[log.time.len() - 1] - log.time[0]).sum();
        let (rate, period, longest) = (scene.rates[row], scene.period, LONGEST * together);
        let step = |k: usize, of: usize| k as f64 / (of - 1) as f64;
        let starts = (0..DURATIONS).flat_map(|i| (0..LEVELS).map(move |k| (i, k)));
        let starts: Vec<[f64; 2]> = starts
            .map(|(i, k)| {
                let level = rate.ln() + UNSEEN.ln() * (1.0 - step(k, LEVELS));
                [level, period.ln() + step(i, DURATIONS) * (0.5 * longest / period).ln()]
            })
            .collect();
        let cost = Cost { account: &account, row, bounds: [(rate * UNSEEN, rate / UNSEEN), (0.5 * period, longest)] };
        let values: Vec<f64> = starts.par_iter().map(|start| cost.at(start)).collect();
        let Some(best) = (0..starts.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])) else { return Ok(None) };
        let around = [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]].map(|d| vec![starts[best][0] + d[0], starts[best][1] + d[1]]);
        let solver = NelderMead::new(around.to_vec()).with_sd_tolerance(1e-3);
        let found =
            solver.ok().and_then(|solver| Executor::new(cost, solver).configure(|s| s.max_iters(STEPS)).run().ok());
        let Some(place) = found.and_then(|found| found.state().get_best_param().cloned()) else { return Ok(None) };
        account.forces.push(Force { row, deviation: place[0].exp(), time: place[1].exp() });
        let Some(found) = account.filtered(&account.forces, false) else { return Ok(None) };
        account.charge(&found);
        Ok(Some(account))
    }

    fn filtered(&self, forces: &[Force], keep: bool) -> Option<Filtered> {
        let refined = &self.fit.refined;
        self.filter.run(&self.fit.experiment, (&refined.parameters, &refined.initial), forces, keep)
    }

    /// The likelihood, less half the logarithm of the sample size for every parameter.
    fn charge(&mut self, found: &Filtered) {
        let parameters = self.fit.evidence.complexity() + 2 * self.forces.len();
        self.score += found.likelihood - 0.5 * parameters as f64 * (found.count.max(2) as f64).ln();
    }

    /// The forces with the curvature of the likelihood at them.
    fn told(&self) -> Vec<Told> {
        let likelihood = |place: usize, change: [f64; 2]| {
            let mut forces = self.forces.clone();
            forces[place].deviation *= change[0].exp();
            forces[place].time *= change[1].exp();
            self.filtered(&forces, false).map_or(f64::NAN, |found| found.likelihood)
        };
        let one = |place: usize| {
            // Wide enough to see the curve beside the rounding, narrow enough to be one.
            let h = 0.1;
            let at = |a: f64, b: f64| likelihood(place, [a * h, b * h]);
            let centre = at(0.0, 0.0);
            let second = |plus: f64, minus: f64| -(plus + minus - 2.0 * centre) / (h * h);
            let (a, b) = (second(at(1.0, 0.0), at(-1.0, 0.0)), second(at(0.0, 1.0), at(0.0, -1.0)));
            let c = -(at(1.0, 1.0) + at(-1.0, -1.0) - at(1.0, -1.0) - at(-1.0, 1.0)) / (4.0 * h * h);
            let determinant = a * b - c * c;
            let covariance = if a > 0.0 && determinant > 0.0 {
                [[b / determinant, -c / determinant], [-c / determinant, a / determinant]]
            } else {
                [[f64::NAN; 2]; 2]
            };
            Told { force: self.forces[place], covariance }
        };
        (0..self.forces.len()).map(one).collect()
    }

    /// Chance that noise gives the best function without a name, in a row or in what a column reads, as large a gain.
    fn functions(&self, contest: &Contest<'_>) -> Result<f64> {
        let Some(found) = self.filtered(&self.forces, true) else { return Ok(0.0) };
        let experiment = &self.fit.experiment;
        let of_columns = rival::of_columns(self.fit.system.model(), &contest.scene, &experiment.columns);
        let in_rows = contest.rivals.iter().map(|r| (Acts::Row(r.state), r));
        let on_columns = of_columns.iter().filter_map(|r| Some((Acts::Column(experiment.column_of(r.state)?), r)));
        let all: Vec<(Acts, &Rival)> = in_rows.chain(on_columns).collect();
        let spent = self.fit.evidence.spent() + 2 * self.forces.len();
        let chance = |(acts, rival): &(Acts, &Rival)| -> Result<f64> {
            let along: Vec<Course> = courses(rival, *acts, &self.fit, &found)?;
            let (gain, degrees) = found.gain(*acts, &along);
            Ok(gain_tail(with_fitted_level(gain, found.count), degrees, found.count, spent))
        };
        let chances = all.par_iter().map(chance).collect::<Result<Vec<f64>>>()?;
        Ok(Searches::of(chances.len()).pay(chances.into_iter().fold(1.0, f64::min)))
    }
}

/// What a random force in a row costs: by the logarithms of its standard deviation and its correlation time.
struct Cost<'a> {
    account: &'a Account,
    row: usize,
    bounds: [(f64, f64); 2],
}

impl Cost<'_> {
    fn at(&self, place: &[f64]) -> f64 {
        let force = Force { row: self.row, deviation: place[0].exp(), time: place[1].exp() };
        let [deviations, times] = self.bounds;
        let is_inside = |value: f64, (low, high): (f64, f64)| (low..=high).contains(&value);
        if !is_inside(force.deviation, deviations) || !is_inside(force.time, times) {
            return f64::INFINITY;
        }
        let forces: Vec<Force> = self.account.forces.iter().copied().chain([force]).collect();
        self.account.filtered(&forces, false).map_or(f64::INFINITY, |found| -found.likelihood)
    }
}

impl CostFunction for Cost<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, place: &Self::Param) -> std::result::Result<f64, argmin::core::Error> {
        Ok(self.at(place))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, Diagnosed, Effect, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, Parameter, State};
    use crate::progress::Silent;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::{Rng, SeedableRng};

    /// A boat that turns at a rate `w` under a rudder; five runs of 400 samples at 20 Hz with noise of a hundredth.
    ///
    /// `force(w, random)`: what else acts, of the rate and an Ornstein-Uhlenbeck process of deviation one and 0.4 s.
    fn boat(force: impl Fn(f64, f64) -> f64) -> Diagnosed {
        let mut model = Model {
            states: vec![State::new("w", Expression::parse("-a*w + g*u").unwrap())],
            parameters: vec![Parameter::new("a", 0.8), Parameter::new("g", 1.5)],
            ..Model::default()
        };
        model.controls.push(Control::new("u"));
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut uniform = move || (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
        let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let (dt, parts) = (0.05, 20);
        let runs = (0..5).map(|run| {
            let (mut w, mut gust) = (0.0, normal());
            let mut rows = Vec::new();
            for i in 0..400 {
                let u = if (i / 37 + run) % 2 == 0 { 0.6 } else { -0.4 };
                rows.push([w + 0.01 * normal(), u]);
                for _ in 0..parts {
                    let h = dt / f64::from(parts);
                    let kept = (-h / 0.4f64).exp();
                    let next = gust * kept + (1.0 - kept * kept).sqrt() * normal();
                    let rate = |w: f64, gust: f64| -0.8 * w + 1.5 * u + force(w, gust);
                    let half = w + 0.5 * h * rate(w, gust);
                    w += h * rate(half, 0.5 * (gust + next));
                    gust = next;
                }
            }
            Run {
                name: format!("run {run}"),
                time: (0..400).map(|i| dt * f64::from(i)).collect(),
                values: Mat::from_fn(400, 2, |i, j| rows[i][j]),
            }
        });
        let data = Dataset::new(vec![Channel::new("w"), Channel::new("u")], runs.collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap()
    }

    #[test]
    fn gusts_are_no_gap_and_their_strength_and_time_come_back() {
        let found = boat(|_, gust| 0.3 * gust).diagnosis;
        assert_eq!(found.verdict, Verdict::NoGap, "{:?}", found.causes);
        let cause = &found.causes[0];
        assert_eq!((cause.effect.as_str(), cause.state.as_str()), (Effect::ProcessNoise.id(), "w"));
        let value = |name: &str| cause.parameters.iter().find(|p| p.name == name).unwrap();
        // Intervals of 95 %; of three with one seed none may be far off.
        for (name, truth) in [("rms", 0.3), ("tau", 0.4), ("q", 2.0 * 0.3 * 0.3 * 0.4)] {
            let p = value(name);
            let (low, high) = (p.low.unwrap(), p.high.unwrap());
            assert!(low < truth * 1.1 && truth * 0.9 < high && high / low < 4.0, "{name}: {low} to {high}");
        }
        assert!(cause.probability > 0.5 && !found.gap.detected);
    }

    #[test]
    fn what_depends_on_the_state_is_not_random() {
        // Neither is in the catalogue: a loss that comes and goes with the rate.
        let found = boat(|w, _| 0.3 * (5.0 * w).sin()).diagnosis;
        assert_ne!(found.verdict, Verdict::NoGap);
        assert!(
            found.causes.iter().all(|c| c.effect != Effect::ProcessNoise.id() || !c.included),
            "{:?}",
            found.causes
        );
    }

    #[test]
    fn a_catalogued_effect_beside_gusts_is_named_beside_them() {
        let found = boat(|w, gust| 0.15 * gust - 0.5 * w * w.abs()).diagnosis;
        let named: Vec<&str> = found.included().map(|c| c.effect.as_str()).collect();
        assert!(named.contains(&Effect::ProcessNoise.id()), "{named:?} {:?}", found.verdict);
        assert!(named.len() == 2, "{named:?}");
    }
}
