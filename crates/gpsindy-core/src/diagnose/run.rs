//! What all steps of one diagnosis share: progress, time limit, and the account of the work.

use crate::diagnose::handed::Handed;
use crate::diagnose::limits::FOREVER;
use crate::diagnose::notes::Note;
use crate::diagnose::report::StageWork;
use crate::error::Result;
use crate::progress::{Progress, step};
use crate::refine::tally::{Counts, Tally};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Ending {
    /// All was tried.
    Complete,
    /// Something was left out because time was up, or somebody had waited long enough.
    Interrupted {
        /// The limit, or when somebody asked for the end, s.
        after: f64,
    },
}

/// One diagnosis under way.
pub(crate) struct Run<'a> {
    progress: &'a dyn Progress,
    /// The user's limit, in seconds on the listener's clock, and the share of it after which the search ends.
    time_limit: Option<f64>,
    share: f64,
    /// Seconds after which something was left out for the first time.
    cut: OnceLock<f64>,
    pub(crate) handed: Account,
    /// What is done with the logs, and how far it was when each stage began.
    pub(crate) tally: Arc<Tally>,
    begun: Mutex<Vec<Begun>>,
}

/// What was handed over to fits.
#[derive(Default)]
pub(crate) struct Account(Mutex<Vec<Handed>>);

impl Account {
    pub(crate) fn add(&self, handed: impl IntoIterator<Item = Handed>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend(handed);
    }

    pub(crate) fn take(&self) -> Vec<Handed> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The beginning of a stage.
struct Begun {
    stage: String,
    counts: Counts,
    seconds: Option<f64>,
}

impl<'a> Run<'a> {
    #[cfg(test)]
    pub(crate) fn new(progress: &'a dyn Progress, time_limit: Option<f64>) -> Self {
        Self::with_share(progress, time_limit, 1.0)
    }

    /// A diagnosis whose search has a share of the time limit; the rest is for what follows it.
    pub(crate) fn with_share(progress: &'a dyn Progress, time_limit: Option<f64>, share: f64) -> Self {
        // Fits are too deep to ask the listener: they get the moment itself.
        let left = time_limit.zip(progress.seconds()).map(|(limit, now)| (share * limit - now).clamp(0.0, FOREVER));
        let end = left.map(|left| Instant::now() + Duration::from_secs_f64(left));
        Self {
            progress,
            time_limit,
            share,
            cut: OnceLock::new(),
            handed: Account::default(),
            tally: Arc::new(Tally::until(end, progress.enough())),
            begun: Mutex::default(),
        }
    }

    /// Whether the search must end with what it has. Asked before a piece of work that is then left out.
    pub(crate) fn is_out_of_time(&self) -> bool {
        let now = self.progress.seconds();
        let is_over = self.left().is_some_and(|left| left <= 0.0) || self.tally.is_over();
        if is_over {
            let limit = self.time_limit.filter(|_| !self.tally.is_enough());
            self.cut.get_or_init(|| limit.or(now).unwrap_or(0.0));
        }
        is_over
    }

    /// Seconds on the listener's clock, where somebody keeps the time.
    pub(crate) fn now(&self) -> Option<f64> {
        self.progress.seconds()
    }

    /// Seconds until the search ends, where there is a limit and somebody keeps the time.
    pub(crate) fn left(&self) -> Option<f64> {
        self.time_limit.zip(self.now()).map(|(limit, now)| (self.share * limit - now).max(0.0))
    }

    /// How the search has ended.
    pub(crate) fn ending(&self) -> Ending {
        self.cut.get().map_or(Ending::Complete, |&after| Ending::Interrupted { after })
    }

    /// What a reader must know about an early end.
    pub(crate) fn note_of_end(&self) -> Option<Note> {
        let Ending::Interrupted { after: seconds } = self.ending() else { return None };
        Some(if self.tally.is_enough() { Note::Stopped { seconds } } else { Note::TimeUp { seconds } })
    }

    /// What is done from now on belongs to a stage that has no parts to report.
    pub(crate) fn begin(&self, stage: &str) {
        let begun = Begun { stage: stage.into(), counts: self.tally.counts(), seconds: self.progress.seconds() };
        self.begun.lock().unwrap_or_else(PoisonError::into_inner).push(begun);
    }

    /// The work of every stage up to now, and its seconds where somebody keeps the time: one row a name, in the order in which
    /// they first began. What follows a stage before the next one begins counts as a part of it.
    pub(crate) fn work(&self) -> (Vec<StageWork>, Vec<f64>) {
        let begun = self.begun.lock().unwrap_or_else(PoisonError::into_inner);
        let (counts, now) = (self.tally.counts(), self.progress.seconds());
        let mut all: Vec<(&str, Counts, f64)> = Vec::new();
        for (place, own) in begun.iter().enumerate() {
            let (end, until) = begun.get(place + 1).map_or((counts, now), |next| (next.counts, next.seconds));
            let seconds = until.zip(own.seconds).map_or(0.0, |(until, from)| until - from);
            let done = end.since(own.counts);
            match all.iter_mut().find(|(name, ..)| *name == own.stage) {
                Some((_, counts, total)) => (*counts, *total) = (counts.plus(done), *total + seconds),
                None => all.push((&own.stage, done, seconds)),
            }
        }
        let row =
            |(stage, Counts { samples: [derivatives, trials, responses], fits, columns }, _): &(&str, Counts, f64)| {
                StageWork {
                    stage: (*stage).into(),
                    fits: *fits,
                    columns: *columns,
                    derivatives: *derivatives,
                    trials: *trials,
                    responses: *responses,
                }
            };
        (all.iter().map(row).collect(), all.iter().map(|(.., seconds)| *seconds).collect())
    }

    /// A stage of `total` parts, reported part by part from whatever thread.
    pub(crate) fn stage<'b>(&'b self, name: &'b str, total: usize) -> Result<Stage<'b>> {
        self.begin(name);
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
    use std::sync::atomic::AtomicBool;

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
    fn diagnosed(time_limit: Option<f64>, clock: &dyn Progress) -> Diagnosed {
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
        assert_eq!(whole.diagnosis.interrupted, None);
        let all = clock.seconds().unwrap();
        // After half of the reports, and at the very start.
        for seconds in [(0.5 * all).floor(), 1.0] {
            let cut = diagnosed(Some(seconds), &Clock::default());
            let verdict = cut.diagnosis.verdict;
            assert!(matches!(verdict, Verdict::PartlyExplained | Verdict::Unexplained), "{seconds}: {verdict}");
            assert!(cut.notes.contains(&Note::TimeUp { seconds }), "{:?}", cut.notes);
            assert_eq!(cut.diagnosis.interrupted, Some(seconds));
        }
    }

    /// A listener whose clock does not advance, as between the reports of a long fit.
    struct Standing;

    impl Progress for Standing {
        fn report(&self, _: &str, _: usize, _: usize) -> bool {
            true
        }

        fn seconds(&self) -> Option<f64> {
            Some(0.0)
        }
    }

    #[test]
    fn a_limit_ends_fits_under_way_though_the_listener_is_not_asked() {
        let work = |limit: Option<f64>| {
            let found = diagnosed(limit, &Standing);
            let trials: u64 = found.diagnosis.work.iter().map(|stage| stage.trials).sum();
            (found.notes.iter().any(|note| matches!(note, Note::TimeUp { .. })), trials)
        };
        let (was_cut, whole) = work(None);
        let (is_cut, trials) = work(Some(1e-9));
        assert!(!was_cut && is_cut);
        // What follows the search fits the starts of held-out rollouts.
        assert!(10 * trials < whole, "{trials} of {whole}");
    }

    #[test]
    fn a_search_with_a_share_of_the_limit_ends_there_and_states_the_limit() {
        let (early, late) = (Clock::default(), Clock::default());
        (0..8).for_each(|_| _ = early.report("", 0, 1));
        (0..9).for_each(|_| _ = late.report("", 0, 1));
        let over = |clock: &dyn Progress| {
            let run = Run::with_share(clock, Some(10.0), 0.9);
            (run.is_out_of_time(), run.note_of_end())
        };
        assert_eq!(over(&early), (false, None));
        assert_eq!(over(&late), (true, Some(Note::TimeUp { seconds: 10.0 })));
    }

    /// A listener who has waited long enough after a number of reports.
    struct Impatient(Arc<AtomicBool>, AtomicUsize);

    impl Progress for Impatient {
        fn report(&self, _: &str, _: usize, _: usize) -> bool {
            if self.1.fetch_add(1, Ordering::Relaxed) == 20 {
                self.0.store(true, Ordering::Relaxed);
            }
            true
        }

        fn seconds(&self) -> Option<f64> {
            Some(7.0)
        }

        fn enough(&self) -> Option<Arc<AtomicBool>> {
            Some(Arc::clone(&self.0))
        }
    }

    #[test]
    fn who_has_waited_long_enough_gets_the_best_so_far() {
        let impatient = Impatient(Arc::default(), AtomicUsize::new(0));
        let found = diagnosed(Some(60.0), &impatient);
        assert_eq!(found.diagnosis.interrupted, Some(7.0));
        assert!(found.notes.contains(&Note::Stopped { seconds: 7.0 }), "{:?}", found.notes);
        assert_ne!(found.diagnosis.verdict, Verdict::Explained);
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
