//! What a search for equations came to, and the same equations fitted to more of the logs.

use crate::data::Dataset;
use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::Algorithm1;
use crate::identify::algorithm1::smooth::smooth;
use crate::identify::notes::Note;
use crate::identify::prepare::prepare;
use crate::identify::settings::Identify;
use crate::identify::support::scope::{Member, Scope};
use crate::progress::Progress;

/// What a search for equations came to, and what it worked on.
pub(crate) struct Searched {
    pub(crate) settings: Identify,
    pub(crate) done: Algorithm1,
    /// None where the regression itself predicts whole runs best.
    pub(crate) member: Option<Member>,
    pub(crate) notes: Vec<Note>,
}

impl Searched {
    /// The same terms, their coefficients fitted to all of `data`; none where nothing was refined or the fit fails. `settings` are
    /// those of the whole.
    pub(crate) fn fitted_to(
        self,
        settings: &Identify,
        data: &Dataset,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let Some(member) = self.member else { return Ok(None) };
        let settings = Identify { train_fraction: settings.train_fraction, ..self.settings };
        let logs = prepare(&settings, data, progress)?;
        let motion = smooth(&settings, &logs, progress)?;
        let done = Algorithm1 { logs, motion, ..self.done };
        let fitter = Scope::new(&settings, &done, progress).fitter(member.hold);
        let trial = unless_cancelled(fitter.fit(&member.trial.equations, member.window, None))?;
        let member = trial.map(|trial| Member { trial, rival: None, ..member });
        Ok(member.is_some().then_some(Self { settings, done, member, notes: self.notes }))
    }
}

#[cfg(test)]
mod tests {
    use crate::identify::limits::SEARCHED;
    use crate::identify::settings::Identify;
    use crate::identify::tests::log;
    use crate::library::LibrarySettings;
    use crate::progress::Silent;

    #[test]
    fn terms_of_an_excerpt_get_the_coefficients_of_all_samples() {
        let rate = |_: f64, x: &[f64]| vec![x[1], -2.0 * x[0]];
        let data = log(&["x", "v"], &[1.0, 0.0], &rate, (0.05, 3 * SEARCHED / 2), 0.02, &|_| vec![], 1);
        let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
        let identify = Identify { states: vec!["x".into(), "v".into()], library, ..Identify::default() };
        let found = identify.fit(&data, &Silent).unwrap();
        assert_eq!(found.states[1].terms, ["x"]);
        assert!(!found.notes.iter().any(|note| note.to_string().contains("were learnt from")), "{:?}", found.notes);
        let record = found.model.identification.as_ref().unwrap();
        let k = record.terms.iter().position(|term| term == "x").unwrap();
        let (value, error) = (record.coefficients[1][k], record.standard_errors[1][k]);
        assert!((value + 2.0).abs() < 4.0 * error && error < 1e-3, "{value} +- {error}");
    }
}
