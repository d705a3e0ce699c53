//! The files of a diagnosis: report.json, report.html, the corrected simulator and what `gpsindy design` reads.

use crate::commands::design::OPEN;
use crate::commands::output::refuse_input;
use crate::engine::Corrected;
use crate::failure::{Failure, Outcome};
use gpsindy_core::diagnose::Diagnosed;
use gpsindy_core::diagnose::report::Diagnosis;
use gpsindy_files::{model_to_toml, start_of, write_together};
use gpsindy_report::{FILES, Provenance};
use std::path::{Path, PathBuf};

/// How the corrected simulator is written.
pub(super) enum Augmented {
    /// As equations.
    Equations,
    /// As the file of its engine.
    File(Corrected),
    /// Not at all.
    None,
}

impl Augmented {
    /// Names the file in the report, and what changed in it on the page.
    pub(super) fn tell(&self, diagnosis: &mut Diagnosis) {
        diagnosis.augmented_model = match self {
            Self::Equations => return,
            Self::File(corrected) => Some(corrected.name.clone()),
            Self::None => None,
        };
        if let (Self::File(corrected), Some(figures)) = (self, &mut diagnosis.figures) {
            figures.difference.clone_from(&corrected.difference);
        }
    }
}

/// Refuses a folder that holds a file which the report would overwrite and gpsindy did not write.
pub(super) fn refuse_others(folder: &Path) -> Outcome {
    for name in FILES {
        if start_of(&folder.join(name)).is_some_and(|start| !gpsindy_report::is_ours(name, &start)) {
            return Err(Failure::input(format!(
                "--out: {} was not written by gpsindy; name another folder, or overwrite it with --force",
                folder.join(name).display()
            )));
        }
    }
    Ok(())
}

/// Refuses a folder in which the report would overwrite what the diagnosis reads.
pub(super) fn refuse_inputs(folder: &Path, inputs: &[&PathBuf]) -> Outcome {
    FILES.iter().try_for_each(|name| refuse_input(&folder.join(name), inputs.iter().copied()))
}

/// Writes the files of a diagnosis of equations.
pub(crate) fn write(folder: &Path, diagnosed: &Diagnosed, provenance: &Provenance) -> Outcome {
    write_with(folder, diagnosed, &Augmented::Equations, Vec::new(), provenance)
}

/// Writes the files of a diagnosis, `beside` among them, in place of those of an earlier one: all or none.
pub(super) fn write_with(
    folder: &Path,
    diagnosed: &Diagnosed,
    augmented: &Augmented,
    beside: Vec<(String, String)>,
    provenance: &Provenance,
) -> Outcome {
    let mut files = beside;
    let mut add = |name: &str, text: String| files.push((name.to_string(), text));
    add("report.json", report_json(&diagnosed.diagnosis)?);
    add("report.html", gpsindy_report::render_with(&diagnosed.diagnosis, provenance));
    match augmented {
        Augmented::Equations => {
            let model = model_to_toml(&diagnosed.augmented)?;
            add("augmented.toml", gpsindy_report::augmented(&diagnosed.diagnosis, &model));
            if diagnosed.open.candidates.len() >= 2 {
                add(OPEN, open_json(diagnosed)?);
            }
        }
        Augmented::File(corrected) => add(&corrected.name, corrected.text.clone()),
        Augmented::None => {}
    }
    std::fs::create_dir_all(folder).map_err(|e| Failure::Work(format!("{}: {e}", folder.display())))?;
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let stale = gpsindy_report::stale(&names, |name| start_of(&folder.join(name)));
    let stale: Vec<PathBuf> = stale.into_iter().map(|name| folder.join(name)).collect();
    let files: Vec<(PathBuf, &[u8])> = files.iter().map(|(name, text)| (folder.join(name), text.as_bytes())).collect();
    Ok(write_together(&files, &stale)?)
}

/// What `gpsindy design` reads: the simulators that the logs can't distinguish, as equations.
fn open_json(diagnosed: &Diagnosed) -> Outcome<String> {
    let text = serde_json::to_string(&diagnosed.open).map_err(|e| Failure::Work(format!("{OPEN}: {e}")))?;
    Ok(text + "\n")
}

/// The report as in report.json.
pub(crate) fn report_json(diagnosis: &Diagnosis) -> Outcome<String> {
    gpsindy_report::json(diagnosis).map_err(|e| Failure::Work(format!("report.json: {e}")))
}
