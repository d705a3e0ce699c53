//! What is left without a name, as a cause that is not included.

use crate::diagnose::catalogue::hypothesis::Hypothesis;
use crate::diagnose::limits::weigh::LIKELY;
use crate::diagnose::report::{Cause, FUNCTION};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::verdict::weigh::Found;
use crate::diagnose::steps::verdict::weigh::decide::Decided;

/// Puts structure without a name among the causes, where it is likelier than not and not included already.
///
/// It acts in the row of the best function of the residual; where only held-out rollouts show it, in the row with the largest share of the gap.
pub(crate) fn list(causes: &mut Vec<Cause>, contest: &Contest<'_>, found: &Found<'_>, decided: &Decided) {
    let unexplained = &decided.unexplained;
    if unexplained.probability <= LIKELY || causes.iter().any(Cause::is_nameless) {
        return;
    }
    let model = found.judged.nominal.system.model();
    let function = found.judged.outcome.left.as_ref().map(|left| Hypothesis::nameless(&contest.rivals[left.rival]));
    let function = function.filter(|_| !unexplained.depends_on.is_empty());
    let row = function.as_ref().and_then(|function| model.states.get(function.moves())).map(|state| state.name.clone());
    let largest = || found.located.gap.by_state.first().map(|row| row.state.clone());
    let Some(state) = row.or_else(largest) else { return };
    let cause = Cause {
        variables: unexplained.depends_on.clone(),
        form: function.map_or(String::new(), |function| function.form()),
        ..Cause::bare(FUNCTION, &state, unexplained.probability.clamp(0.0, 1.0))
    };
    let is_behind = |other: &Cause| !other.included && other.probability <= cause.probability;
    let place = causes.iter().position(is_behind).unwrap_or(causes.len());
    causes.insert(place, cause);
}
