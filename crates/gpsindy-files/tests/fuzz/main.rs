//! Broken logs of every format: no panic, no hang, and no memory beyond four times the file.
//!
//! A short run is part of every test. The long one, 100,000 files a format, takes ten minutes of a core
//! (`TMPDIR` in memory, as /dev/shm, spares the disk):
//! `cargo test --release -p gpsindy-files --test fuzz -- --ignored --nocapture`
#![allow(clippy::unwrap_used, unsafe_code, clippy::print_stdout)]
#![cfg(all(feature = "mcap", feature = "parquet", feature = "ulog"))]

mod faults;
mod memory;
mod wholes;

use faults::{Random, broken};
use gpsindy_core::Silent;
use gpsindy_files::{Logs, inspect};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;
use wholes::{Format, Whole, formats};

/// Files of each format in the ordinary run, and in the long one.
const ROUNDS: usize = 400;
const LONG_ROUNDS: usize = 100_000;

/// Large files, of so many times the short one's length, in both runs.
const LARGE: usize = 200;
const LARGE_ROUNDS: usize = 8;
const LONG_LARGE_ROUNDS: usize = 300;

/// Memory that a log may take: this many times its file, and what reading may take however short a file is: buffers, tables.
const TIMES: usize = 4;
const ALWAYS: usize = 4 << 20;

/// What became of the files of a format.
#[derive(Default)]
struct Outcome {
    read: usize,
    inspected: usize,
    /// Most memory of the whole files, as a multiple of their length.
    whole: f64,
    /// Most memory of any, as a share of what is allowed.
    most: f64,
    slowest: f64,
}

/// Writes a log, with faults in one of its files; one file of a folder may be missing. Returns its length.
fn save(whole: &Whole, at: &Path, random: Option<&mut Random>) -> usize {
    let Some(random) = random else {
        return whole.iter().map(|(name, bytes)| put(at, name, bytes)).sum();
    };
    let place = random.below(whole.len());
    let lost = whole.len() > 1 && random.below(50) == 0;
    let mut length = 0;
    for (i, (name, bytes)) in whole.iter().enumerate() {
        let path = if name.is_empty() { at.to_path_buf() } else { at.join(name) };
        length += match i == place {
            true if lost => {
                let _ = std::fs::remove_file(path);
                0
            }
            true => put(at, name, &broken(bytes, random)),
            false => put(at, name, bytes),
        };
    }
    length
}

fn put(at: &Path, name: &str, bytes: &[u8]) -> usize {
    let path = if name.is_empty() { at.to_path_buf() } else { at.join(name) };
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    // A file that is cut to nothing and written again is flushed to the disk by some file systems.
    let _ = std::fs::remove_file(&path);
    std::fs::write(path, bytes).unwrap();
    bytes.len()
}

fn fuzz(format: &Format, rounds: usize) {
    let Format { name, wholes, options, columns } = format;
    let own = name.replace([' ', ','], "_");
    let folder = std::env::temp_dir().join(format!("gpsindy-fuzz-{}-{own}-{rounds}", std::process::id()));
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut found = Outcome::default();
    for round in 0..rounds {
        let whole = &wholes[round % wholes.len()];
        let path = folder.join((round % wholes.len()).to_string());
        // The first round of each is the whole file.
        let unbroken = round < wholes.len();
        let length = save(whole, &path, (!unbroken).then_some(&mut random));
        let length = length.max(whole.iter().map(|(_, bytes)| bytes.len()).sum());
        let (mut read, mut inspected) = (false, false);
        let begin = Instant::now();
        let held = memory::most(|| {
            let work = AssertUnwindSafe(|| {
                read = Logs::read(&[&path], options).and_then(|logs| logs.dataset(columns, &[])).is_ok();
                inspected = inspect(&path, options, &Silent).map(|i| (i.text(100), i.json())).is_ok();
            });
            assert!(catch_unwind(work).is_ok(), "{name}, round {round}: a panic; the log is {}", path.display());
        });
        found.slowest = found.slowest.max(begin.elapsed().as_secs_f64());
        let allowed = TIMES * length + ALWAYS;
        assert!(held <= allowed, "{name}, round {round}: {held} bytes for {length}; the log is {}", path.display());
        assert!(!unbroken || (read && inspected), "{name}: the whole log is not read; it is {}", path.display());
        if unbroken {
            found.whole = found.whole.max(held as f64 / length as f64);
        }
        found.read += usize::from(read);
        found.inspected += usize::from(inspected);
        found.most = found.most.max(held as f64 / allowed as f64);
    }
    std::fs::remove_dir_all(&folder).unwrap();
    let length: usize = wholes[0].iter().map(|(_, bytes)| bytes.len()).sum();
    let Outcome { read, inspected, whole, most, slowest } = found;
    println!(
        "{name}: {rounds} files of {} kB, {read} read, {inspected} inspected, memory {whole:.2} times the whole file, \
         at most {most:.2} of what is allowed, slowest {slowest:.3} s",
        length / 1000
    );
    assert!(read < rounds && inspected > 0);
}

/// Formats whose name begins so, short and large.
fn all(name: &str, rounds: usize, large: usize) {
    let own = |format: &&Format| format.name.starts_with(name);
    formats(1).iter().filter(own).for_each(|format| fuzz(format, rounds));
    formats(LARGE).iter().filter(own).for_each(|format| fuzz(format, format.wholes.len() + large));
}

#[test]
fn broken_logs_of_every_format_neither_panic_nor_swell() {
    all("", ROUNDS, LARGE_ROUNDS);
}

#[test]
#[ignore = "minutes; see the top of the file"]
fn broken_mcap_in_the_long_run() {
    all("mcap", LONG_ROUNDS, LONG_LARGE_ROUNDS);
}

#[test]
#[ignore = "minutes; see the top of the file"]
fn broken_parquet_in_the_long_run() {
    all("parquet", LONG_ROUNDS, LONG_LARGE_ROUNDS);
}

#[test]
#[ignore = "minutes; see the top of the file"]
fn broken_data_sets_in_the_long_run() {
    all("lerobot", LONG_ROUNDS, LONG_LARGE_ROUNDS);
}

#[test]
#[ignore = "minutes; see the top of the file"]
fn broken_ulog_in_the_long_run() {
    all("ulog", LONG_ROUNDS, LONG_LARGE_ROUNDS);
}

#[test]
#[ignore = "minutes; see the top of the file"]
fn broken_csv_in_the_long_run() {
    all("csv", LONG_ROUNDS, LONG_LARGE_ROUNDS);
}
