//! A report on logs that count time in another unit than the second.

use crate::diagnose::report::Diagnosis;
use crate::model::unit::in_time_unit;

impl Diagnosis {
    /// Names rates per `time_unit` in place of per second.
    pub(crate) fn count_time_in(&mut self, time_unit: &str) {
        for unit in units_of_rates(self) {
            *unit = in_time_unit(unit, time_unit);
        }
    }
}

/// The units in a report that may be those of a rate.
fn units_of_rates(diagnosis: &mut Diagnosis) -> impl Iterator<Item = &mut String> {
    let gap = diagnosis.gap.by_state.iter_mut().map(|row| &mut row.unit);
    let causes = diagnosis.causes.iter_mut().flat_map(|cause| cause.units());
    let parameters = diagnosis.parameters.iter_mut().map(|p| &mut p.unit);
    let excluded = diagnosis.excluded.iter_mut().map(|row| &mut row.unit);
    let parts =
        diagnosis.by_part.iter_mut().flat_map(|part| part.nothing_above.iter_mut().map(|bound| &mut bound.unit));
    let power = diagnosis.power.iter_mut().flat_map(|power| power.effects.iter_mut().map(|row| &mut row.unit));
    let figures = diagnosis.figures.iter_mut().flat_map(|f| f.residuals.iter_mut().map(|figure| &mut figure.unit));
    gap.chain(causes).chain(parameters).chain(excluded).chain(parts).chain(power).chain(figures)
}
