//! Settle: the rollouts, tolerances, corners and integration steps by which causes are distinguished.

mod charge;
mod sharpen;

use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::substeps::{exact, finer};
use crate::diagnose::limits::{Budget, STEADY};
use crate::diagnose::notes::Note;
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::lengthen::lengthen;
use crate::diagnose::steps::attribution::screen::nameless;
use crate::diagnose::steps::attribution::simplify::{Pruned, pruned};
use crate::error::Result;
use charge::{Charged, charge_tolerated};
use sharpen::{Sharpened, sharpened};

/// The nominal model and what was found, on the rollouts and with the tolerances by which causes are distinguished.
pub(crate) struct Settled {
    pub(crate) nominal: Contestant,
    pub(crate) best: Contestant,
    /// The same without each of its effects, where that was looked at.
    pub(crate) rests: Option<Vec<Option<Contestant>>>,
    /// Gain and degrees of freedom of every function without a name beside them.
    pub(crate) left: Vec<(f64, usize)>,
    /// Which rollouts or tolerances are others now.
    pub(crate) notes: Vec<Note>,
    /// Whether these or the steps of the integration are.
    pub(crate) is_moved: bool,
    /// Whether starts of windows were drawn anew.
    pub(crate) is_redrawn: bool,
}

/// Settles what was found: without effects that are superfluous, on longer rollouts, with tolerated parameters that are errors as causes,
/// with corners as sharp as the logs show them, and on steps of the integration that no effect gains by.
pub(crate) fn settle(contest: &Contest<'_>, nominal: Contestant, found: &Contestant) -> Result<Settled> {
    contest.run.begin("settling");
    let Pruned { best, rests } = pruned(contest, &nominal, found.clone())?;
    let (mut nominal, mut best, mut notes) = (nominal, best, Vec::new());
    if let Some(longer) = lengthen(contest, &nominal, &best, STEADY)? {
        (nominal, best) = longer;
        notes.push(Note::Lengthened);
    }
    if let Some(charged) = charge_tolerated(contest, &nominal, &best)? {
        let names;
        Charged { nominal, best, names } = charged;
        notes.extend(names.into_iter().map(|name| Note::ChargedParameter { name }));
    }
    let Sharpened { best: sharp, left } = sharpened(contest, &best)?;
    let mut is_other = sharp.is_some();
    if let Some(sharp) = sharp {
        nominal.experiment.substeps = sharp.experiment.substeps;
        best = sharp;
    }
    // Where a rest is left no effect is decided by what the integration adds to it.
    let shorter = if best.evidence.leaves_a_rest() { finer } else { exact };
    if let Some(finer) = shorter(&best).filter(|_| !contest.run.is_out_of_time()) {
        nominal.experiment.substeps = finer.substeps;
        best.experiment.substeps = finer.substeps;
        // From where they are: starts that the logs show may lead elsewhere.
        nominal = contest.fitter.carried_on(nominal, Budget::Usual)?;
        best = contest.fitter.carried_on(best, Budget::Thorough)?;
        is_other = true;
    }
    let mut is_redrawn = false;
    if !best.evidence.leaves_a_rest() && !contest.run.is_out_of_time() {
        let squares = best.evidence.squares();
        best = contest.fitter.redrawn_by_column(best, Budget::Usual)?;
        is_redrawn = best.evidence.squares() < squares;
    }
    let is_moved = !notes.is_empty() || is_other;
    // Once more, because longer rollouts show what an effect is worth.
    let is_new = is_moved || is_redrawn;
    let Pruned { best, rests } = if is_new { pruned(contest, &nominal, best)? } else { Pruned { best, rests } };
    // What was asked of a single effect still holds, unless that effect is another fit now.
    let left = left.filter(|_| !is_other && !is_redrawn).map_or_else(|| nameless(contest, &best), Ok)?;
    Ok(Settled { nominal, best, rests, left, notes, is_moved, is_redrawn })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::data::Dataset;
    use crate::diagnose::fixture::{drive, slider, slider_model};
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, hold_out};
    use crate::model::Model;
    use crate::progress::Silent;

    /// What is named of a machine with a dry friction of 0.3 whose sign is smoothed over a corner, and the corner found.
    fn named(model: &Model, data: &Dataset) -> (Verdict, Vec<String>, Option<f64>) {
        let (train, holdout) = hold_out(data).unwrap();
        let frictions = ["coulomb_friction", "stribeck_friction", "asymmetric_friction", "viscous_friction"];
        let diagnose = Diagnose { effects: frictions.map(String::from).into(), ..Diagnose::default() };
        let found = diagnose.run(model, &train, &holdout, &Silent).unwrap().diagnosis;
        let corner = found.included().flat_map(|cause| &cause.parameters).find(|p| p.name == "w").map(|p| p.value);
        (found.verdict, found.included().map(|cause| cause.effect.clone()).collect(), corner)
    }

    #[test]
    fn what_the_integration_adds_to_a_long_log_is_no_further_effect() {
        // A tenth of the noise is sixty nats here.
        let rate = |x: f64, v: f64, u: f64| u - 4.0 * x - 0.4 * v - 0.3 * (v / 0.01).tanh();
        let input = |time: f64, run: f64| {
            1.5 * (0.7 * time + run).sin() + if ((time / 1.2).floor() + run) % 2.0 == 0.0 { -0.8 } else { 0.8 }
        };
        let data = slider(1, rate, input, [0.002, 0.002], 2000);
        let (verdict, names, corner) = named(&slider_model("u - 4*x - 0.4*v"), &data);
        assert_eq!((verdict, names), (Verdict::Explained, vec!["coulomb_friction".to_string()]));
        assert!((corner.unwrap() - 0.01).abs() < 1e-3, "{corner:?}");
    }

    #[test]
    fn a_corner_sharper_than_a_step_of_the_integration_is_found() {
        let (model, data) = drive(None, |x| x + 0.3 * (x / 4e-3).tanh(), 5e-4, (4, 400));
        let (verdict, names, corner) = named(&model, &data);
        assert_eq!((verdict, names), (Verdict::Explained, vec!["coulomb_friction".to_string()]));
        assert!((corner.unwrap() - 4e-3).abs() < 4e-4, "{corner:?}");
    }
}
