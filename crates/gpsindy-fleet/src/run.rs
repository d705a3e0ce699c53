//! Computes the missing tasks of a fleet: those without a report.

use crate::manifest::Manifest;
use crate::store::Store;
use crate::task::{Task, report};
use gpsindy_core::diagnose::Diagnose;
use gpsindy_core::{Error as CoreError, Progress};
use gpsindy_files::{LogOptions, Result};
use rayon::prelude::*;
use std::str::FromStr;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One part of a fleet's tasks: number `part` of `parts`, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 1.
    pub part: usize,
    /// How many parts there are.
    pub parts: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parse = || {
            let (part, parts) = text.split_once('/')?;
            let shard = Self { part: part.trim().parse().ok()?, parts: parts.trim().parse().ok()? };
            (1..=shard.parts).contains(&shard.part).then_some(shard)
        };
        parse().ok_or_else(|| format!("expected K/N with K from 1 to N, found `{text}`"))
    }
}

/// How a fleet is diagnosed.
#[derive(Debug, Clone)]
pub struct Fleet {
    /// Settings of every diagnosis.
    pub diagnose: Diagnose,
    /// How columns are found in the logs.
    pub options: LogOptions,
    /// Tasks at a time.
    pub jobs: Option<usize>,
    /// The part of the tasks that is done here; all where absent.
    pub shard: Option<Shard>,
}

/// What became of one task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Attempt {
    /// It was done now; the key of its report.
    Done(String),
    /// Its report was there; its key.
    Found(String),
    /// It failed, and why.
    Failed(String),
    /// It belongs to another part, which has not come to it yet.
    Missing,
}

/// What a run of a fleet did: what became of every task of the manifest, in its order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// One entry a task.
    pub attempts: Vec<Attempt>,
}

impl Summary {
    /// Tasks that were done now.
    pub fn done(&self) -> usize {
        self.count(|a| matches!(a, Attempt::Done(_)))
    }

    /// Tasks whose report was there already.
    pub fn found(&self) -> usize {
        self.count(|a| matches!(a, Attempt::Found(_)))
    }

    /// Tasks that failed.
    pub fn failed(&self) -> usize {
        self.count(|a| matches!(a, Attempt::Failed(_)))
    }

    /// Tasks of other parts that are still at work.
    pub fn missing(&self) -> usize {
        self.count(|a| matches!(a, Attempt::Missing))
    }

    fn count(&self, is: impl Fn(&Attempt) -> bool) -> usize {
        self.attempts.iter().filter(|a| is(a)).count()
    }
}

impl Fleet {
    /// Diagnoses every unit and period whose report is not in the store yet. A task that fails is reported and does not end the others. The tasks
    /// of other parts are only looked at.
    ///
    /// # Errors
    /// A request to stop, threads that can't be had, or a store that does not answer.
    pub fn run(&self, manifest: &Manifest, store: &dyn Store, progress: &dyn Progress) -> Result<Summary> {
        let is_own = |k: usize| self.shard.is_none_or(|s| k % s.parts == s.part - 1);
        let total = (0..manifest.tasks.len()).filter(|&k| is_own(k)).count();
        let whole = Whole { progress, finished: AtomicUsize::new(0), total };
        let one = |(k, task): (usize, &Task)| {
            if !is_own(k) {
                return Ok(Attempt::Missing);
            }
            let attempt =
                if whole.go_on() { self.attempt(task, store, &whole) } else { Err(CoreError::Cancelled.into()) };
            whole.finished.fetch_add(1, Ordering::Relaxed);
            whole.go_on();
            attempt
        };
        let work = || manifest.tasks.par_iter().enumerate().map(one).collect::<Result<Vec<Attempt>>>();
        let mut attempts = match self.jobs {
            None => work(),
            Some(jobs) => {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build();
                pool.map_err(|e| CoreError::file(format!("{jobs} jobs: {e}")))?.install(work)
            }
        }?;
        // Looked at last: the other parts were at work meanwhile.
        for (attempt, task) in attempts.iter_mut().zip(&manifest.tasks).filter(|(a, _)| **a == Attempt::Missing) {
            *attempt = self.look(task, store)?;
        }
        Ok(Summary { attempts })
    }

    /// Does one task unless its report is there; a failure is recorded in the store and is no error here.
    ///
    /// # Errors
    /// A request to stop, or a store that does not answer.
    pub fn attempt(&self, task: &Task, store: &dyn Store, progress: &dyn Progress) -> Result<Attempt> {
        match self.one(task, store, progress) {
            Ok(attempt) => {
                task.tell(store, None)?;
                Ok(attempt)
            }
            Err(gpsindy_files::Error::Core(CoreError::Cancelled)) => Err(CoreError::Cancelled.into()),
            Err(error) => {
                task.tell(store, Some(&error.to_string()))?;
                Ok(Attempt::Failed(error.to_string()))
            }
        }
    }

    fn one(&self, task: &Task, store: &dyn Store, progress: &dyn Progress) -> Result<Attempt> {
        let key = task.key(&self.diagnose, &self.options)?;
        if store.has(&report(&key))? {
            return Ok(Attempt::Found(key));
        }
        task.run(&self.diagnose, &self.options, (store, &key), progress)?;
        Ok(Attempt::Done(key))
    }

    /// What is in the store of a task.
    fn look(&self, task: &Task, store: &dyn Store) -> Result<Attempt> {
        if let Some(error) = task.failed(store)? {
            return Ok(Attempt::Failed(error));
        }
        // A file that can't be read here may be there where the task is done.
        let Ok(key) = task.key(&self.diagnose, &self.options) else { return Ok(Attempt::Missing) };
        Ok(if store.has(&report(&key))? { Attempt::Found(key) } else { Attempt::Missing })
    }
}

/// Shows how many tasks are finished, and passes a request to stop on; a task's own steps are too many to show.
struct Whole<'a> {
    progress: &'a dyn Progress,
    finished: AtomicUsize,
    total: usize,
}

impl Whole<'_> {
    fn go_on(&self) -> bool {
        self.progress.report("diagnose", self.finished.load(Ordering::Relaxed), self.total)
    }
}

impl Progress for Whole<'_> {
    fn report(&self, _stage: &str, _done: usize, _total: usize) -> bool {
        self.go_on()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shard_is_k_of_n() {
        assert_eq!("2/16".parse(), Ok(Shard { part: 2, parts: 16 }));
        for bad in ["0/3", "4/3", "3", "a/b", "1/0"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
