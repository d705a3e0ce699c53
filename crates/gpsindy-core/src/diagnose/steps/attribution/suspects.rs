//! Suspects: the effects that could act in this model under these logs, and the generic smooth functions.

use crate::diagnose::catalogue::custom::CustomEffect;
use crate::diagnose::catalogue::enumerate::everything;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::catalogue::invariance;
use crate::diagnose::catalogue::joint;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::Family;
use crate::diagnose::catalogue::rival::{self, Rival};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::outputs::scene_of;
use crate::diagnose::notes::Note;
use crate::diagnose::parts::Part;
use crate::diagnose::steps::logs::noise::moves;
use crate::error::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};

/// Who takes part in a contest.
pub(crate) struct Suspects {
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// Those that become suspects where an effect that imitates them leads.
    pub(crate) behind: Vec<Hypothesis>,
    /// Sets of hypotheses (indices) that also apply together.
    pub(crate) joint: Vec<Vec<usize>>,
    /// Functions without a name.
    pub(crate) rivals: Vec<Rival>,
    pub(crate) scene: Scene,
    /// Variables that say where the machine is, and that no rate depends on.
    pub(crate) places: Vec<String>,
    /// Whether random forces are suspects.
    pub(crate) random: bool,
}

/// Which effects are suspects.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Choice<'a> {
    /// Ids of those that are; where empty, all but those that must be asked for.
    pub(crate) chosen: &'a [String],
    /// Ids of those that are not.
    pub(crate) without: &'a [String],
    /// Effects of the user's own.
    pub(crate) custom: &'a [CustomEffect],
    /// Joints and actuators of the machine; a control of none of them, as the motion of a base, is measured and no command.
    pub(crate) parts: &'a [Part],
    /// Parts of the machine in which effects are suspects; where empty, everywhere. Those of the user's own always are.
    pub(crate) only: &'a [Part],
    /// Whether an effect may depend on where the machine is where no rate of the model does.
    pub(crate) places: bool,
    /// Whether effects that make no sense at a place are suspects there.
    pub(crate) senseless: bool,
}

/// Every effect that can act in the nominal model, of those of `choice`; and notes of those that make no sense there.
///
/// # Errors
/// No effect that can act; an effect of the user's own in a state that the model lacks.
pub(crate) fn suspects(nominal: &Contestant, choice: &Choice<'_>) -> Result<(Suspects, Vec<Note>)> {
    let model = nominal.system.model();
    let mut scene = scene_of(nominal);
    let mut all = everything(model, &scene, &nominal.experiment.columns, choice.custom)?;
    let is_suspect = |id: &str, is_only_if_asked: bool| {
        let is_chosen = match choice.chosen.is_empty() {
            true => !is_only_if_asked,
            false => choice.chosen.iter().any(|e| e == id),
        };
        is_chosen && !choice.without.iter().any(|e| e == id)
    };
    let waits = |h: &Hypothesis| h.waits() && choice.chosen.is_empty() && is_suspect(h.id(), false);
    all.retain(|h| is_suspect(h.id(), h.is_only_if_asked()) || waits(h));
    let is_asked = |h: &Hypothesis| {
        let state = &model.states[h.state].name;
        let has = |part: &Part| part.has(model, h.place().as_deref(), &h.variables, state);
        let is_command = |name: &String| choice.parts.iter().any(|part| part.controls.contains(name));
        let control = h.variables.iter().find(|name| model.control_index(name).is_some());
        let is_measured = !choice.parts.is_empty() && control.is_some_and(|name| !is_command(name));
        let is_part = choice.only.is_empty() || choice.only.iter().any(has);
        h.effect().is_none() || (is_part && !is_measured)
    };
    all.retain(is_asked);
    let mut notes = Vec::new();
    if let Some(parts) = (!choice.only.is_empty()).then(|| choice.only.iter().map(|part| part.name.clone()).collect()) {
        notes.push(Note::OnlyParts { parts });
    }
    let random =
        choice.only.is_empty() && is_suspect(Effect::ProcessNoise.id(), Effect::ProcessNoise.is_only_if_asked());
    // The equations of a simulator that is no text don't say what they depend on.
    let known = nominal.system.simulator().is_none();
    let places = if known && !choice.places && !choice.senseless { invariance::places(model) } else { Vec::new() };
    let still = still(nominal);
    let rests = |h: &Hypothesis| {
        let is_of_place = matches!(h.family(), Family::Stiffness | Family::Coupling);
        is_of_place && h.variables.iter().any(|name| still.contains(name))
    };
    let mut ruled_out: BTreeMap<Rule, BTreeSet<String>> = BTreeMap::new();
    let mut hypotheses = Vec::new();
    for hypothesis in all {
        let place = invariance::broken(&hypothesis, &places).filter(|_| !hypothesis.marks_a_place());
        let place = place.map(|place| Rule::Place(place.to_string()));
        let sense = || {
            let broken = hypothesis.broken_sense(model, &scene);
            broken.or_else(|| rests(&hypothesis).then_some(Sense::Moves(0))).filter(|_| !choice.senseless)
        };
        match place.or_else(|| sense().map(|sense| Rule::Sense(sense.words()))) {
            Some(rule) => _ = ruled_out.entry(rule).or_default().insert(hypothesis.id().to_string()),
            None => hypotheses.push(hypothesis),
        }
    }
    let is_late = |h: &Hypothesis| choice.chosen.is_empty() && invariance::broken(h, &places).is_some();
    let (behind, hypotheses): (Vec<_>, Vec<_>) = hypotheses.into_iter().partition(|h| waits(h) || is_late(h));
    for (rule, effects) in ruled_out {
        let effects = effects.into_iter().collect();
        notes.push(match rule {
            Rule::Place(place) => Note::PlaceRuledOut { place, effects },
            Rule::Sense(needs) => Note::RuledOut { needs: needs.into(), effects },
        });
    }
    if hypotheses.is_empty() && !random {
        return Err(Error::settings("no effect of the chosen ones can act in this model; choose others"));
    }
    let late = joint::late(&hypotheses);
    let joint = [joint::frictions(model, &hypotheses), joint::exchanges(model, &hypotheses), late].concat();
    let rivals = rival::enumerate(model, &scene, model.states.len());
    // The place of a machine that moves alike everywhere acts on nothing.
    scene.clocks.retain(|name| !places.contains(&name.as_str()));
    let places = places.into_iter().map(String::from).collect();
    Ok((Suspects { hypotheses, behind, joint, rivals, scene, places, random }, notes))
}

/// States whose columns never move: where such a place is, a spring, a weight or another axis is a constant, which has a name of its own.
fn still(nominal: &Contestant) -> Vec<String> {
    let experiment = &nominal.experiment;
    let columns = experiment.columns.iter().enumerate();
    let still = columns.filter(|(column, _)| !moves(&experiment.logs, *column));
    still.map(|(_, &state)| nominal.system.model().states[state].name.clone()).collect()
}

/// Why an effect is no suspect at a place.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rule {
    /// It would depend on this place, which no rate does.
    Place(String),
    /// It lacks this.
    Sense(&'static str),
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Dataset, Run};
    use crate::diagnose::fixture::{drive, fitted};
    use crate::diagnose::{Diagnose, hold_out};
    use crate::expression::Expression;
    use crate::model::{Control, Model, State};
    use crate::progress::Silent;
    use crate::random::normal;
    use faer::Mat;
    use rand_chacha::ChaCha8Rng;
    use rand_core::SeedableRng;

    /// How many suspects are a spring or another axis of a second joint that goes to and fro over `moves` of the first one's way.
    fn on_the_other(moves: f64) -> usize {
        let (mut model, data) = drive(None, |x| x, 0.01, (3, 200));
        model.states.push(State::new("other", Expression::parse("-other").unwrap()));
        let with_other = |run: &Run| Run {
            values: Mat::from_fn(run.n_samples(), 3, |i, c| {
                if c < 2 { run.values[(i, c)] } else { 0.1 + moves * run.values[(i, 0)] }
            }),
            ..run.clone()
        };
        let channels = ["x", "u", "other"].map(Channel::new).to_vec();
        let data = Dataset::new(channels, data.runs().iter().map(with_other).collect()).unwrap();
        let nominal = fitted(&model, &data, 0.01).1;
        let is_of_other = |h: &&Hypothesis| {
            let is_of_place = matches!(h.family(), Family::Stiffness | Family::Coupling);
            is_of_place && h.variables.iter().any(|name| name == "other")
        };
        suspects(&nominal, &Choice::default()).unwrap().0.hypotheses.iter().filter(is_of_other).count()
    }

    #[test]
    fn what_never_moves_is_no_spring_and_no_other_axis() {
        assert!(on_the_other(1.0) > 0);
        assert_eq!(on_the_other(0.0), 0);
    }

    #[test]
    fn commands_that_are_late_together_are_found_in_one_round() {
        const STEP: f64 = 0.02;
        let state = |name: &str, equation: &str| State::new(name, Expression::parse(equation).unwrap());
        let model = Model {
            states: vec![state("x", "3*(a - x)"), state("y", "5*(b - y)"), state("z", "4*(c - z)")],
            controls: ["a", "b", "c"].map(Control::new).into(),
            ..Model::default()
        };
        let rates = [3.0, 5.0, 4.0];
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let runs = (0..4).map(|run| {
            let command = |i: usize, axis: usize| (0.05 * (1.0 + 0.4 * axis as f64) * i as f64 + run as f64).sin();
            let mut values = Mat::zeros(200, 6);
            let mut at = [0.0; 3];
            for i in 0..200 {
                for axis in 0..3 {
                    values[(i, axis)] = at[axis] + 0.002 * normal(&mut random);
                    values[(i, 3 + axis)] = command(i, axis);
                    // Three samples late.
                    let aim = command(i.saturating_sub(3), axis);
                    at[axis] = aim + (at[axis] - aim) * (-rates[axis] * STEP).exp();
                }
            }
            let time = (0..200).map(|i| STEP * f64::from(i)).collect();
            Run { name: format!("run {run}"), time, values }
        });
        let data = Dataset::new(["x", "y", "z", "a", "b", "c"].map(Channel::new).into(), runs.collect()).unwrap();
        let (train, holdout) = hold_out(&data).unwrap();
        let found = Diagnose::default().run(&model, &train, &holdout, &Silent).unwrap();
        let named: Vec<&str> = found.diagnosis.included().map(|cause| cause.effect.as_str()).collect();
        assert_eq!(named, ["input_delay"; 3], "{:?}", found.diagnosis.verdict);
        let first = found.handed.iter().position(|fit| fit.members.len() == 3);
        let two = found.handed.iter().position(|fit| fit.members.len() == 2);
        assert!(first.is_some() && (two.is_none() || first < two), "{first:?} {two:?}");
    }
}
