//! Suspects: the effects that could act in this model under these logs, and the generic smooth functions.

use crate::diagnose::catalogue::effect::CustomEffect;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::hypothesis::{Hypothesis, enumerate};
use crate::diagnose::catalogue::joint;
use crate::diagnose::catalogue::rival::{self, Rival};
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::outputs::scene_of;
use crate::error::{Error, Result};

/// Who takes part in a contest.
pub(crate) struct Suspects {
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// Sets of hypotheses (indices) that also apply together.
    pub(crate) joint: Vec<Vec<usize>>,
    /// Functions without a name.
    pub(crate) rivals: Vec<Rival>,
    pub(crate) scene: Scene,
}

/// Every effect that can act in the nominal model: of the `chosen` ones (where none is, all but those that must be asked for),
/// without those left out.
///
/// # Errors
/// No effect that can act; an effect of the user's own in a state that the model lacks.
pub(crate) fn suspects(
    nominal: &Contestant,
    chosen: &[String],
    without: &[String],
    custom: &[CustomEffect],
) -> Result<Suspects> {
    let model = nominal.system.model();
    let scene = scene_of(nominal);
    let mut hypotheses = enumerate(model, &scene, &nominal.experiment.columns, custom)?;
    hypotheses.retain(|h| {
        let is_chosen = match chosen.is_empty() {
            true => !h.is_only_if_asked(),
            false => chosen.iter().any(|e| e == h.id()),
        };
        is_chosen && !without.iter().any(|e| e == h.id())
    });
    if hypotheses.is_empty() {
        return Err(Error::invalid("no effect of the chosen ones can act in this model; choose others"));
    }
    let joint = [joint::frictions(model, &hypotheses), joint::exchanges(model, &hypotheses)].concat();
    let rivals = rival::enumerate(model, &scene, model.states.len());
    Ok(Suspects { hypotheses, joint, rivals, scene })
}
