//! The result, batch or online, as an [`Identification`].

use crate::identify::algorithm1::regress::Chosen;
use crate::identify::equations::Equations;
use crate::identify::notes::Note;
use crate::identify::outlook::Outlook;
use crate::identify::result::{DelayReport, Fidelity, Identification, StateReport};
use crate::model::IdentificationRecord;
use crate::refine::Hold;

/// Equations with all that is known of them.
pub(crate) struct Found {
    pub(crate) equations: Equations,
    /// Standard error of each coefficient (n x p).
    pub(crate) errors: Vec<Vec<f64>>,
    /// Probability of each term (n x p), or nothing.
    pub(crate) inclusion: Vec<Vec<f64>>,
    /// Standard error of each delay that was estimated, then of each free number.
    pub(crate) delay_errors: Vec<f64>,
    /// Noise of every state's column.
    pub(crate) noise: Vec<f64>,
    pub(crate) window: Option<f64>,
    pub(crate) hold: Hold,
    pub(crate) fidelity: Option<Fidelity>,
    pub(crate) outlook: Option<Outlook>,
}

/// `chosen` is the regression of every state whose equation was not given, `kernels` those of the smoother.
pub(crate) fn report(found: Found, chosen: &[Option<Chosen>], kernels: &[String], notes: Vec<Note>) -> Identification {
    let equations = &found.equations;
    let names = equations.library.names();
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    let of = |s: usize, pick: fn(&Chosen) -> f64| chosen[s].as_ref().map(pick).and_then(finite);
    let states = (0..equations.n_states()).map(|s| StateReport {
        state: equations.states[s].0.clone(),
        terms: equations.support.terms(s).iter().map(|&j| names[j].to_string()).collect(),
        level: of(s, |c| c.level),
        score: of(s, |c| c.score),
        residual: of(s, |c| c.residual),
        noise: found.noise[s],
        kernel: kernels[s].clone(),
    });
    let states: Vec<StateReport> = states.collect();
    let mut free = found.delay_errors.into_iter();
    let late = equations.delays.iter().zip(&equations.controls).filter(|(d, _)| d.free || d.value != 0.0);
    let delays = late.map(|(d, (control, _))| DelayReport {
        control: control.clone(),
        delay: d.value,
        standard_error: if d.free { free.next() } else { None },
    });
    let delays = delays.collect();
    let mut model = equations.model();
    for number in &mut model.parameters {
        let error = free.next().map(|error| error / number.value.abs());
        number.tolerance = error.filter(|share| share.is_finite());
    }
    model.identification = Some(IdentificationRecord {
        terms: names.iter().map(ToString::to_string).collect(),
        coefficients: equations.coefficients.clone(),
        standard_errors: found.errors,
        inclusion_probabilities: found.inclusion,
        lambda: states.iter().map(|s| s.level.unwrap_or(0.0)).collect(),
        hold: (!equations.controls.is_empty()).then_some(found.hold),
    });
    Identification {
        model,
        states,
        delays,
        window: found.window,
        hold: found.hold,
        fidelity: found.fidelity,
        outlook: found.outlook,
        notes,
    }
}
