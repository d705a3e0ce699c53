//! `gpsindy-suite draw`: writes cases of random plants with known effects.

use clap::{Parser, Subcommand, ValueEnum};
use gpsindy_suite::case::{Kind, draw_named};
use gpsindy_suite::emit::{Answer, answer, files};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(about = "Random plants with withheld effects, to examine the diagnosis", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Writes one case a seed, and the answers.
    Draw {
        /// First seed.
        #[arg(long)]
        seed_from: u64,
        /// Seed after the last one.
        #[arg(long)]
        seed_to: u64,
        /// Folder to write; it must not exist or be empty.
        #[arg(long)]
        out: PathBuf,
        /// Kind of all cases; mixed: half single, a tenth pairs, 15 % outside the catalogue, a quarter nulls.
        #[arg(long, value_enum, default_value = "mixed")]
        kind: Choice,
        /// This effect in every case.
        #[arg(long)]
        effect: Option<String>,
    },
}

#[derive(Clone, Copy, ValueEnum)]
enum Choice {
    Single,
    Pair,
    Outside,
    Beside,
    Null,
    Second,
    Mixed,
}

#[derive(serde::Serialize)]
struct Answers {
    schema: &'static str,
    case: Vec<Answer>,
}

fn main() -> ExitCode {
    let Command::Draw { seed_from, seed_to, out, kind, effect } = Arguments::parse().command;
    let kind = match kind {
        Choice::Single => Some(Kind::Single),
        Choice::Pair => Some(Kind::Pair),
        Choice::Outside => Some(Kind::Outside),
        Choice::Beside => Some(Kind::Beside),
        Choice::Null => Some(Kind::Null),
        Choice::Second => Some(Kind::Second),
        Choice::Mixed => None,
    };
    match write(seed_from, seed_to, &out, kind, effect.as_deref()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("gpsindy-suite: {message}");
            ExitCode::from(2)
        }
    }
}

fn write(from: u64, to: u64, out: &Path, kind: Option<Kind>, effect: Option<&str>) -> Result<(), String> {
    if to <= from {
        return Err(format!("--seed-to must be above --seed-from {from}, found {to}"));
    }
    let failed = |path: &Path, e: std::io::Error| format!("{}: {e}", path.display());
    if out.read_dir().is_ok_and(|mut d| d.next().is_some()) {
        return Err(format!("{} is not empty; name a new folder", out.display()));
    }
    std::fs::create_dir_all(out).map_err(|e| failed(out, e))?;
    let seeds: Vec<u64> = (from..to).collect();
    let entries: Vec<Result<Option<Answer>, String>> = seeds
        .par_iter()
        .map(|&seed| {
            let Some(case) = draw_named(seed, kind, effect) else { return Ok(None) };
            let id = format!("case_{seed:02}");
            let folder = out.join(&id);
            std::fs::create_dir_all(&folder).map_err(|e| failed(&folder, e))?;
            for (name, text) in files(&case) {
                let path = folder.join(name);
                std::fs::write(&path, text).map_err(|e| failed(&path, e))?;
            }
            Ok(Some(answer(&case, &id)))
        })
        .collect();
    let mut list = Vec::new();
    for (entry, seed) in entries.into_iter().zip(&seeds) {
        match entry? {
            Some(answer) => list.push(answer),
            None => eprintln!("gpsindy-suite: seed {seed}: no plant took the effect; the case is left out"),
        }
    }
    let answers = Answers { schema: "gpsindy.suite/1", case: list };
    let text = toml::to_string(&answers).map_err(|e| e.to_string())?;
    let path = out.join("answers.toml");
    std::fs::write(&path, text).map_err(|e| failed(&path, e))
}
