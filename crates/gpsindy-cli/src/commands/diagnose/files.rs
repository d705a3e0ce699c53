//! The files of a diagnosis: report.json, report.html, the corrected simulator and what `gpsindy design` reads.

use crate::commands::design::OPEN;
use crate::engine::Corrected;
use crate::failure::{Failure, Outcome};
use gpsindy_core::diagnose::Diagnosed;
use gpsindy_core::diagnose::report::Diagnosis;
use gpsindy_files::{model_to_toml, write_whole};
use gpsindy_report::Provenance;
use std::path::Path;

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
    let engines = ["augmented.xml", "augmented.ssv", "randomization.py"];
    for name in ["report.json", "report.html", "augmented.toml", OPEN].into_iter().chain(engines) {
        let path = folder.join(name);
        let Ok(bytes) = std::fs::read(&path) else { continue };
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(4096)]).into_owned();
        if !gpsindy_report::is_ours(name, &start) {
            return Err(Failure::input(format!(
                "--out: {} was not written by gpsindy; name another folder, or overwrite it with --force",
                path.display()
            )));
        }
    }
    Ok(())
}

/// Writes the three files of a diagnosis of equations.
pub(crate) fn write(folder: &Path, diagnosed: &Diagnosed, provenance: &Provenance) -> Outcome {
    write_with(folder, diagnosed, &Augmented::Equations, provenance)
}

pub(super) fn make(folder: &Path) -> Outcome {
    std::fs::create_dir_all(folder).map_err(|e| Failure::Work(format!("{}: {e}", folder.display())))
}

pub(super) fn write_with(
    folder: &Path,
    diagnosed: &Diagnosed,
    augmented: &Augmented,
    provenance: &Provenance,
) -> Outcome {
    // All texts first, so that nothing is written where one of them fails.
    let html = gpsindy_report::render_with(&diagnosed.diagnosis, provenance);
    let json = report_json(&diagnosed.diagnosis)?;
    let corrected = match augmented {
        Augmented::Equations => {
            let model = model_to_toml(&diagnosed.augmented)?;
            Some(("augmented.toml", gpsindy_report::augmented(&diagnosed.diagnosis, &model)))
        }
        Augmented::File(corrected) => Some((corrected.name.as_str(), corrected.text.clone())),
        Augmented::None => None,
    };
    make(folder)?;
    write_whole(&folder.join("report.json"), json.as_bytes())?;
    write_whole(&folder.join("report.html"), html.as_bytes())?;
    if let Some((name, text)) = corrected {
        write_whole(&folder.join(name), text.as_bytes())?;
    }
    Ok(())
}

/// What `gpsindy design` reads: the simulators that the logs can't distinguish, as equations.
pub(super) fn write_open(folder: &Path, diagnosed: &Diagnosed, augmented: &Augmented) -> Outcome {
    let path = folder.join(OPEN);
    if !matches!(augmented, Augmented::Equations) || diagnosed.open.candidates.len() < 2 {
        // One of an earlier diagnosis would be taken for this one's.
        if path.exists() {
            std::fs::remove_file(&path).map_err(|e| Failure::Work(format!("{}: {e}", path.display())))?;
        }
        return Ok(());
    }
    let text = serde_json::to_string(&diagnosed.open).map_err(|e| Failure::Work(format!("{OPEN}: {e}")))?;
    Ok(write_whole(&path, (text + "\n").as_bytes())?)
}

/// The report as in report.json.
pub(crate) fn report_json(diagnosis: &Diagnosis) -> Outcome<String> {
    gpsindy_report::json(diagnosis).map_err(|e| Failure::Work(format!("report.json: {e}")))
}
