//! Alone: the nominal model beside random forces, without any effect.

use super::account::Account;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::limits::{CONVINCING, IN_SIGHT};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::findings::Left;
use crate::error::Result;
use std::cell::OnceCell;

/// The nominal model beside random forces without any effect, which is looked for at most once: on a part of the readings, and on all.
pub(super) struct Alone<'a> {
    pub(super) nominal: &'a Contestant,
    part: OnceCell<Option<Account>>,
    account: OnceCell<Option<Account>>,
    /// Score of what was found without forces, beside forces of its own on the same part.
    pub(super) rival: f64,
}

impl<'a> Alone<'a> {
    pub(super) fn of(nominal: &'a Contestant) -> Self {
        Self { nominal, part: OnceCell::new(), account: OnceCell::new(), rival: f64::NEG_INFINITY }
    }

    /// The same beside a `rival` of that score.
    pub(super) fn against(self, rival: f64) -> Self {
        Self { rival, ..self }
    }

    pub(super) fn part(&self, contest: &Contest<'_>) -> Result<Option<Account>> {
        once(&self.part, || Account::in_part(contest, self.nominal))
    }

    /// None where the part speaks against it already.
    pub(super) fn account(&self, contest: &Contest<'_>) -> Result<Option<Account>> {
        let in_sight = |part: &Account| part.score > self.rival - IN_SIGHT;
        let whole = || self.part(contest)?.filter(in_sight).map_or(Ok(None), |part| part.on_all(contest));
        once(&self.account, whole)
    }

    /// What is left beside forces that the logs speak more of than of sensors whose noise has a memory: what a machine does with a force shows in
    /// all of its columns at once. None where they don't.
    pub(super) fn law(&self, contest: &Contest<'_>) -> Result<Option<Law>> {
        let forced = self.account(contest)?.map_or_else(|| self.part(contest), |account| Ok(Some(account)))?;
        let Some(forced) = forced.filter(Account::is_forced) else { return Ok(None) };
        let Some(lead) = forced.lead_over_sensors(contest)?.filter(|&lead| lead > CONVINCING) else { return Ok(None) };
        let (p_value, rival) = forced.law(contest)?;
        let energy = (self.nominal.evidence.misfit() - 1.0).max(0.0);
        let left =
            rival.map(|rival| Left { energy, p_value, rival, depends_on: contest.rivals[rival].variables.clone() });
        Ok(Some(Law { chance: (-lead).exp(), left }))
    }
}

/// A gap that looks like noise of the sensors.
pub(super) struct Law {
    /// Chance that it is that.
    pub(super) chance: f64,
    /// What is left beside a random force.
    pub(super) left: Option<Left>,
}

/// What the cell holds, made where it is empty.
fn once<T: Clone>(cell: &OnceCell<T>, make: impl FnOnce() -> Result<T>) -> Result<T> {
    if let Some(known) = cell.get() {
        return Ok(known.clone());
    }
    let made = make()?;
    Ok(cell.get_or_init(|| made).clone())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fit::colours::coherence::chance_of_coherence;
    use crate::diagnose::fixture::fitted;
    use crate::diagnose::report::Verdict;
    use crate::diagnose::run::Run as Progress;
    use crate::diagnose::steps::attribution::suspects::{Choice, suspects};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, State};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// A tank circuit of 5 Hz whose capacitance swings by a share `pumped`, with an error of its voltmeter of so many times its noise of 0.03 that
    /// rings at 17 Hz; four logs of 5 s at 200 Hz.
    fn tank(pumped: f64, error: f64) -> (Model, Dataset) {
        let states = [("v", "i/0.01"), ("i", "(u - i - v)/0.1")];
        let states = states.map(|(name, equation)| State::new(name, Expression::parse(equation).unwrap())).into();
        let model = Model { states, controls: vec![Control::new("u")], ..Model::default() };
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let runs = (0..4).map(|run| {
            let (step, fine) = (0.005, 40);
            let (mut v, mut i, mut rings) = (0.0, 0.0, [0.0; 2]);
            let mut values = Mat::zeros(1000, 3);
            for row in 0..1000_i32 {
                let at = step * f64::from(row);
                let steps = f64::from((row / 90 * 7 + run * 3) % 5 - 2);
                let u = 3.0 * (3.0 * at + 0.4 * at * at * f64::from(run) + f64::from(run)).sin() + 0.8 * steps;
                let next = 2.0 * 0.98 * (17.0 * std::f64::consts::TAU * step).cos() * rings[0] - 0.98 * 0.98 * rings[1];
                rings = [next + 0.2 * normal(&mut random), rings[0]];
                values[(row as usize, 0)] = v + 0.03 * (normal(&mut random) + error * rings[0]);
                values[(row as usize, 1)] = i + 0.03 * normal(&mut random);
                values[(row as usize, 2)] = u;
                for part in 0..fine {
                    let h = step / f64::from(fine);
                    let swing = 1.0 + pumped * (11.3 * (at + h * f64::from(part)) + 2.0 * f64::from(run)).cos();
                    i += h * (u - i - v) / 0.1;
                    v += h * i / 0.01 * swing;
                }
            }
            Run { name: format!("{run}"), time: (0..1000_i32).map(|row| step * f64::from(row)).collect(), values }
        });
        (model, Dataset::new(["v", "i", "u"].map(Channel::new).into(), runs.collect()).unwrap())
    }

    #[test]
    fn what_shows_in_two_columns_at_once_is_no_noise_of_a_sensor() {
        let found = |(model, data): (Model, Dataset)| {
            let (fitter, nominal) = fitted(&model, &data, 0.03);
            let run = Progress::new(&Silent, None);
            let contest = Contest::new(&run, fitter, suspects(&nominal, &Choice::default()).unwrap().0, 6);
            let law = Alone::of(&nominal).law(&contest).unwrap();
            let row = law.and_then(|law| Some(contest.rivals[law.left?.rival].state));
            (nominal.evidence.leaves_a_rest(), chance_of_coherence(&nominal), row)
        };
        let (leaves_a_rest, chance, row) = found(tank(0.1, 0.0));
        assert!(leaves_a_rest && chance < 1e-9 && row == Some(0), "{chance} {row:?}");
        let (leaves_a_rest, chance, _) = found(tank(0.0, 1.5));
        assert!(leaves_a_rest && chance > 0.05, "{chance}");
    }

    /// A cart on a spring of half a hertz that is pushed for a second at a time, and a command in steps; four logs of 24 s at 50 Hz, with noise of a third
    /// of what the push does to either column.
    fn cart() -> (Model, Dataset) {
        let states = [("p", "v"), ("v", "(u - 14*p - 2.2*v)/1.6")];
        let states = states.map(|(name, equation)| State::new(name, Expression::parse(equation).unwrap())).into();
        let model = Model { states, controls: vec![Control::new("u")], ..Model::default() };
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let runs = (0..4).map(|run| {
            let (step, fine) = (0.02, 20);
            let (mut p, mut v, mut push, mut values) = (0.0, 0.0, 0.3 * normal(&mut random), Mat::zeros(1200, 3));
            for row in 0..1200_i32 {
                let u = f64::from((row / 140 * 5 + run * 3) % 7 - 3) * 2.0;
                values[(row as usize, 0)] = p + 0.02 * normal(&mut random);
                values[(row as usize, 1)] = v + 0.05 * normal(&mut random);
                values[(row as usize, 2)] = u;
                for _ in 0..fine {
                    let h = step / f64::from(fine);
                    let kept = (-h).exp();
                    push = push * kept + 0.3 * (1.0 - kept * kept).sqrt() * normal(&mut random);
                    v += h * ((u - 14.0 * p - 2.2 * v) / 1.6 + push);
                    p += h * v;
                }
            }
            Run { name: format!("{run}"), time: (0..1200_i32).map(|row| step * f64::from(row)).collect(), values }
        });
        (model, Dataset::new(["p", "v", "u"].map(Channel::new).into(), runs.collect()).unwrap())
    }

    #[test]
    fn slow_gusts_on_a_spring_are_random() {
        let (model, data) = cart();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis;
        let named: Vec<&str> = found.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(
            (named.as_slice(), found.verdict),
            (&["process_noise"][..], Verdict::Explained),
            "{:?}",
            found.checks
        );
        let rms = found.included().next().and_then(|c| c.parameters.iter().find(|p| p.name == "rms")).unwrap();
        assert!((0.2..0.4).contains(&rms.value), "{rms:?}");
    }

    #[test]
    fn a_voltmeter_that_rings_is_no_gap() {
        let (model, data) = tank(0.0, 1.5);
        let (train, holdout) = hold_out(&data).unwrap();
        assert_eq!(
            Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap().diagnosis.verdict,
            Verdict::NoGap
        );
    }
}
