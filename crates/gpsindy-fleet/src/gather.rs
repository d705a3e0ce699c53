//! Collects the reports of a fleet and compares them; one report is in memory at a time.

use crate::date;
use crate::manifest::Manifest;
use crate::run::Attempt;
use crate::store::Store;
use crate::task::{self, Task};
use gpsindy_core::diagnose::report::{Cause, Diagnosis, Parameter};
use gpsindy_core::fleet::report::{Failed, FleetReport, Unit, UnitCause};
use gpsindy_core::fleet::{Compare, Observation, Quantity};
use gpsindy_files::Result;
use std::collections::{BTreeMap, HashSet};

/// Standard deviations from one end of a 95 % interval to the other.
const INTERVAL: f64 = 2.0 * 1.96;

/// Standard deviations up to the size that an exclusion names: 5 % and 95 % points of a normal variable, one-sided.
const EXCLUSION: f64 = 2.0 * 1.645;

/// Effect, state and name of a size.
type Name = (String, String, String);

/// What the reports say of each size, and of where it is absent.
#[derive(Default)]
struct Sizes {
    units: BTreeMap<Name, String>,
    found: BTreeMap<Name, Vec<Observation>>,
    /// Effect and state, observations of a size of 0.
    absent: BTreeMap<(String, String), Vec<Observation>>,
}

/// Reads the reports of a fleet, compares the units, and writes `fleet.json` and `fleet.html` next to them.
///
/// `attempts` says what became of every task of the manifest; those that are missing are left out.
///
/// # Errors
/// A report that can't be read, a file that can't be written, another number of attempts than of tasks.
pub fn compare(manifest: &Manifest, attempts: &[Attempt], store: &dyn Store) -> Result<FleetReport> {
    if attempts.len() != manifest.tasks.len() {
        let what = format!("{} attempts at {} tasks", attempts.len(), manifest.tasks.len());
        return Err(gpsindy_core::Error::file(what).into());
    }
    let mut report = FleetReport::new();
    let mut sizes = Sizes::default();
    for (task, attempt) in manifest.tasks.iter().zip(attempts) {
        let key = match attempt {
            Attempt::Done(key) | Attempt::Found(key) => key,
            Attempt::Missing => continue,
            Attempt::Failed(error) => {
                let (unit, since) = (task.unit.clone(), task.since.clone());
                report.failed.push(Failed { unit, since, error: error.clone() });
                continue;
            }
        };
        let name = task::report(key);
        let unreadable = |what: String| {
            gpsindy_core::Error::file(format!("{}: {what}; remove it to have it made again", store.place(&name)))
        };
        let text = store.read(&name)?.ok_or_else(|| unreadable("it is gone".into()))?;
        let diagnosis: Diagnosis = serde_json::from_slice(&text).map_err(|e| unreadable(e.to_string()))?;
        sizes.add(task, &diagnosis, &manifest.covariates);
        report.units.push(unit(task, &diagnosis, key.clone()));
    }
    let quantities = sizes.quantities(&manifest.covariates);
    let found = Compare::default().run(&quantities)?;
    (report.population, report.odd, report.changes) = (found.population, found.odd, found.changes);
    if manifest.tasks.iter().any(|task| task.since.as_deref().is_some_and(date::is_date)) {
        for change in &mut report.changes {
            change.date = date::date(change.since).unwrap_or_default();
        }
    }
    if quantities.is_empty() && !report.units.is_empty() {
        report.notes.push("no effect was found in two units or periods: there is nothing to compare".into());
    }
    let json = serde_json::to_string_pretty(&report).map_err(|e| gpsindy_core::Error::file(e.to_string()))? + "\n";
    let page = gpsindy_report::fleet::render(&report);
    store.write_together(&[("fleet.html", page.as_bytes()), ("fleet.json", json.as_bytes())])?;
    Ok(report)
}

/// Standard error of a size by its interval.
fn error(parameter: &Parameter) -> Option<f64> {
    Some((parameter.high? - parameter.low?) / INTERVAL).filter(|error| *error > 0.0)
}

fn unit(task: &Task, diagnosis: &Diagnosis, key: String) -> Unit {
    let cause = |cause: &Cause| UnitCause {
        effect: cause.effect.clone(),
        state: cause.state.clone(),
        probability: cause.probability,
        sizes: cause.parameters.iter().map(|p| (p.name.clone(), p.value)).collect(),
        errors: cause.parameters.iter().filter_map(|p| Some((p.name.clone(), error(p)?))).collect(),
    };
    Unit {
        unit: task.unit.clone(),
        since: task.since.clone(),
        day: task.since.as_deref().and_then(date::days),
        verdict: diagnosis.verdict.to_string(),
        causes: diagnosis.included().map(cause).collect(),
        closure: diagnosis.closure.closed,
        key,
        covariates: task.covariates.clone(),
    }
}

impl Sizes {
    fn add(&mut self, task: &Task, diagnosis: &Diagnosis, covariates: &[String]) {
        let observation = |value: f64, deviation: f64| Observation {
            unit: task.unit.clone(),
            since: task.since.as_deref().and_then(date::days),
            value,
            deviation,
            covariates: covariates.iter().map(|name| task.covariates[name]).collect(),
        };
        for cause in diagnosis.included() {
            // A wrong parameter is named by its variable: its size is called `value` in every such cause.
            let of = |name: &str| match cause.variables.first() {
                Some(parameter) if cause.effect == "parameter_error" => parameter.clone(),
                _ => name.to_string(),
            };
            for parameter in &cause.parameters {
                if let Some(deviation) = error(parameter) {
                    let name = (cause.effect.clone(), cause.state.clone(), of(&parameter.name));
                    self.units.entry(name.clone()).or_insert_with(|| parameter.unit.clone());
                    self.found.entry(name).or_default().push(observation(parameter.value, deviation));
                }
            }
        }
        for excluded in &diagnosis.excluded {
            let deviation = excluded.above / EXCLUSION;
            if deviation > 0.0 {
                let place = (excluded.effect.clone(), excluded.state.clone());
                self.absent.entry(place).or_default().push(observation(0.0, deviation));
            }
        }
    }

    /// One quantity a size that at least two units or periods have. A unit in which the effect is ruled out above a size has it at zero,
    /// with that error; one whose logs say nothing of it is left out.
    fn quantities(self, covariates: &[String]) -> Vec<Quantity> {
        let Self { units, found, absent } = self;
        let of = |(name, mut observations): (Name, Vec<Observation>)| {
            let (effect, state, parameter) = name.clone();
            // Only the size that scales an effect is zero where the effect is absent.
            let scales = matches!(parameter.as_str(), "c" | "tau");
            let period = |o: &Observation| (o.unit.clone(), o.since.map(f64::to_bits));
            let there: HashSet<_> = observations.iter().map(period).collect();
            let zeros = absent.get(&(effect.clone(), state.clone())).into_iter().flatten().filter(|_| scales);
            let zeros: Vec<Observation> = zeros.filter(|o| !there.contains(&period(o))).cloned().collect();
            observations.extend(zeros);
            let unit = units.get(&name).cloned().unwrap_or_default();
            Quantity { effect, state, parameter, unit, covariates: covariates.to_vec(), observations }
        };
        found.into_iter().map(of).filter(|quantity| quantity.observations.len() > 1).collect()
    }
}
