//! What all steps of one diagnosis share: progress, time limit and notes.

use crate::diagnose::notes::{Note, Notes};
use crate::error::Result;
use crate::progress::{Progress, step};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// One diagnosis under way.
pub(crate) struct Run<'a> {
    progress: &'a dyn Progress,
    /// Seconds on the listener's clock at which the search ends.
    time_limit: Option<f64>,
    /// Whether something was left out because time was up.
    is_cut: AtomicBool,
    pub(crate) notes: Notes,
}

impl<'a> Run<'a> {
    pub(crate) fn new(progress: &'a dyn Progress, time_limit: Option<f64>) -> Self {
        Self { progress, time_limit, is_cut: AtomicBool::new(false), notes: Notes::default() }
    }

    /// Whether the search must end with what it has. Asked before a piece of work that is then left out.
    pub(crate) fn is_out_of_time(&self) -> bool {
        let is_over = self.time_limit.zip(self.progress.seconds()).is_some_and(|(limit, now)| now >= limit);
        if is_over {
            self.is_cut.store(true, Ordering::Relaxed);
        }
        is_over
    }

    /// Whether time was up before the search came to its end.
    pub(crate) fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
    }

    /// Says that the search was cut, where it was.
    pub(crate) fn say_if_cut(&self) {
        if let Some(seconds) = self.time_limit.filter(|_| self.is_cut()) {
            self.notes.say(Note::TimeUp { seconds });
        }
    }

    /// A stage of `total` parts, reported part by part from whatever thread.
    pub(crate) fn stage<'b>(&'b self, name: &'b str, total: usize) -> Result<Stage<'b>> {
        let stage = Stage { progress: self.progress, name, done: AtomicUsize::new(0), total };
        step(self.progress, name, 0, total)?;
        Ok(stage)
    }
}

/// A stage under way.
pub(crate) struct Stage<'a> {
    progress: &'a dyn Progress,
    name: &'a str,
    done: AtomicUsize,
    total: usize,
}

impl Stage<'_> {
    /// One more part is through.
    ///
    /// # Errors
    /// A request to stop.
    pub(crate) fn advance(&self) -> Result<()> {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        step(self.progress, self.name, done.min(self.total), self.total)
    }

    /// So many parts are through.
    ///
    /// # Errors
    /// A request to stop.
    pub(crate) fn reach(&self, done: usize) -> Result<()> {
        step(self.progress, self.name, done.min(self.total), self.total)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diagnose::fixture::drive;
    use crate::diagnose::report::Verdict;
    use crate::diagnose::{Diagnose, Diagnosed, hold_out};
    use std::sync::Mutex;

    /// A listener whose clock goes on by one second at every report.
    #[derive(Default)]
    struct Clock(Mutex<Vec<(String, usize, usize)>>);

    impl Progress for Clock {
        fn report(&self, stage: &str, done: usize, total: usize) -> bool {
            self.0.lock().unwrap().push((stage.into(), done, total));
            true
        }

        fn seconds(&self) -> Option<f64> {
            Some(self.0.lock().unwrap().len() as f64)
        }
    }

    /// A drive with a drag that its model lacks.
    fn diagnosed(time_limit: Option<f64>, clock: &Clock) -> Diagnosed {
        let (model, data) = drive(None, |x| x + 0.8 * x * x.abs(), 0.01, (3, 200));
        let (train, holdout) = hold_out(&data).unwrap();
        Diagnose { time_limit, ..Diagnose::default() }.run(&model, &train, &holdout, clock).unwrap()
    }

    #[test]
    fn a_search_whose_time_is_up_ends_with_what_it_has_and_claims_no_whole_explanation() {
        let clock = Clock::default();
        let whole = diagnosed(None, &clock);
        assert_eq!(whole.diagnosis.verdict, Verdict::Explained, "{:?}", whole.diagnosis.causes);
        assert!(!whole.notes.iter().any(|note| matches!(note, Note::TimeUp { .. })));
        let all = clock.seconds().unwrap();
        // After half of the reports, and at the very start.
        for seconds in [(0.5 * all).floor(), 1.0] {
            let cut = diagnosed(Some(seconds), &Clock::default());
            let verdict = cut.diagnosis.verdict;
            assert!(matches!(verdict, Verdict::PartlyExplained | Verdict::Unexplained), "{seconds}: {verdict}");
            assert!(cut.notes.contains(&Note::TimeUp { seconds }), "{:?}", cut.notes);
            assert!(cut.diagnosis.notes.iter().any(|note| note.starts_with("the time limit of")));
        }
    }

    #[test]
    fn every_stage_counts_up_to_a_total_from_the_first_fit_on() {
        let clock = Clock::default();
        diagnosed(None, &clock);
        let reports = clock.0.into_inner().unwrap();
        for stage in ["length of rollouts", "nominal model: fitting", "suspects: screening", "suspects: fitting"] {
            let of: Vec<(usize, usize)> = reports.iter().filter(|r| r.0 == stage).map(|r| (r.1, r.2)).collect();
            assert!(of.len() > 1, "{stage}: {of:?}");
            assert!(of.iter().all(|(done, total)| *total > 0 && done <= total), "{stage}: {of:?}");
        }
        assert_eq!(reports[0].0, "length of rollouts");
    }
}
