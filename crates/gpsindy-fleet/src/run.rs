//! Computes the missing tasks below a folder: those without a report.

use crate::manifest::Manifest;
use crate::task::Task;
use gpsindy_core::diagnose::Diagnose;
use gpsindy_core::{Error as CoreError, Progress};
use gpsindy_files::{LogOptions, Result};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
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
    /// It was done now.
    Done,
    /// Its report was there.
    Found,
    /// It failed, and why.
    Failed(String),
}

/// What a run of a fleet did.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// Tasks that were done now.
    pub done: usize,
    /// Tasks whose report was there already.
    pub found: usize,
    /// Tasks that other shards do.
    pub elsewhere: usize,
    /// Unit, period and reason of the tasks that failed.
    pub failed: Vec<(Task, String)>,
}

impl Fleet {
    /// The folder of a task below the fleet's.
    ///
    /// # Errors
    /// A file of the task that can't be read.
    pub fn folder(&self, task: &Task, out: &Path) -> Result<PathBuf> {
        Ok(out.join("tasks").join(task.key(&self.diagnose, &self.options)?))
    }

    /// Tasks that are neither done nor known to have failed: those of other parts that are still at work.
    pub fn missing(&self, manifest: &Manifest, out: &Path) -> usize {
        let is_there = |task: &Task| self.folder(task, out).is_ok_and(|folder| folder.join("report.json").is_file());
        manifest.tasks.iter().filter(|task| task.failed(out).is_none() && !is_there(task)).count()
    }

    /// Diagnoses every unit and period whose report is not below `out` yet. A task that fails is told and does not end the others.
    ///
    /// # Errors
    /// A request to stop, or threads that can't be had.
    pub fn run(&self, manifest: &Manifest, out: &Path, progress: &dyn Progress) -> Result<Summary> {
        let is_own = |k: usize| self.shard.is_none_or(|s| k % s.parts == s.part - 1);
        let own: Vec<&Task> = manifest.tasks.iter().enumerate().filter(|(k, _)| is_own(*k)).map(|(_, t)| t).collect();
        let whole = Whole { progress, finished: AtomicUsize::new(0), total: own.len() };
        let one = |task: &&Task| {
            let attempt =
                if whole.go_on() { self.attempt(task, out, &whole) } else { Err(CoreError::Cancelled.into()) };
            whole.finished.fetch_add(1, Ordering::Relaxed);
            whole.go_on();
            attempt
        };
        let work = || own.par_iter().map(one).collect::<Result<Vec<Attempt>>>();
        let attempts = match self.jobs {
            None => work(),
            Some(jobs) => {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build();
                pool.map_err(|e| CoreError::file(format!("{jobs} jobs: {e}")))?.install(work)
            }
        }?;
        let mut summary = Summary { elsewhere: manifest.tasks.len() - own.len(), ..Summary::default() };
        for (task, attempt) in own.into_iter().zip(attempts) {
            match attempt {
                Attempt::Done => summary.done += 1,
                Attempt::Found => summary.found += 1,
                Attempt::Failed(error) => summary.failed.push((task.clone(), error)),
            }
        }
        Ok(summary)
    }

    /// Does one task unless its report is there; a failure is told below `out` and is no error here.
    ///
    /// # Errors
    /// A request to stop, or a folder that can't be written.
    pub fn attempt(&self, task: &Task, out: &Path, progress: &dyn Progress) -> Result<Attempt> {
        match self.one(task, out, progress) {
            Ok(attempt) => {
                task.tell(out, None)?;
                Ok(attempt)
            }
            Err(gpsindy_files::Error::Core(CoreError::Cancelled)) => Err(CoreError::Cancelled.into()),
            Err(error) => {
                task.tell(out, Some(&error.to_string()))?;
                Ok(Attempt::Failed(error.to_string()))
            }
        }
    }

    fn one(&self, task: &Task, out: &Path, progress: &dyn Progress) -> Result<Attempt> {
        let folder = self.folder(task, out)?;
        if folder.join("report.json").is_file() {
            return Ok(Attempt::Found);
        }
        task.run(&self.diagnose, &self.options, &folder, progress)?;
        Ok(Attempt::Done)
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
