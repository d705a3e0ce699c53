//! Faults from outside: kills at random times, a disk without room, a reader that goes away, two runs into one folder.
//!
//! After each of them every file is whole, and the program has said in one line what happened. A report is replaced as a whole, except where
//! a kill falls between the renames of its files: how many did is reported.

use crate::shell;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Kills of each command.
const KILLS: usize = 30;

/// Seed of the times of the kills.
const SEED: u64 = 1;

const SLIDER: &str = "schema = \"gpsindy.model/1\"\nname = \"slider\"\n[[state]]\nname = \"v\"\nunit = \"m/s\"\nequation = \"-b*v\"\n[[parameter]]\nname = \"b\"\nvalue = 0.2\n";

/// Two diagnoses whose reports differ in every file.
const CONFIDENCES: [&str; 2] = ["0.9", "0.95"];

pub(crate) fn run() -> Result<(), String> {
    shell::run("cargo", "build --release -p gpsindy-cli".split(' '), &[])?;
    let lab = Lab::new()?;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    lab.kill_diagnoses(&mut rng)?;
    lab.kill_identifications(&mut rng)?;
    lab.kill_fleets(&mut rng)?;
    lab.lack_room()?;
    lab.refuse_the_disk()?;
    lab.close_the_pipe()?;
    lab.share_a_folder()?;
    shell::say("faults: every file was whole and every failure one line\n");
    Ok(())
}

/// A folder with a simulator, logs and a manifest; removed at the end.
struct Lab {
    folder: PathBuf,
    program: PathBuf,
}

impl Drop for Lab {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

impl Lab {
    fn new() -> Result<Self, String> {
        let folder = std::env::temp_dir().join(format!("gpsindy-faults-{}", std::process::id()));
        fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| shell::root().join("target"), PathBuf::from);
        let lab =
            Self { folder, program: target.join("release").join(format!("gpsindy{}", std::env::consts::EXE_SUFFIX)) };
        lab.write("slider.toml", SLIDER)?;
        let mut manifest = String::from("model = \"slider.toml\"\n");
        for unit in 0..4 {
            for run in 0..4 {
                let (start, drag) = (1.5 + 0.5 * f64::from(run) + 0.01 * f64::from(unit), 0.3 + 0.01 * f64::from(unit));
                lab.write(&format!("unit_{unit}_{run}.csv"), &coast(start, drag))?;
            }
            manifest += &format!("[[unit]]\nunit = \"s{unit}\"\nlogs = \"unit_{unit}_*.csv\"\n");
        }
        lab.write("fleet.toml", &manifest)?;
        Ok(lab)
    }

    fn write(&self, name: &str, text: &str) -> Result<(), String> {
        fs::write(self.folder.join(name), text).map_err(|e| format!("{name}: {e}"))
    }

    fn read(&self, name: &str) -> Result<String, String> {
        fs::read_to_string(self.folder.join(name)).map_err(|e| format!("{name}: {e}"))
    }

    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(&self.program);
        command.args(line.split(' ')).current_dir(&self.folder);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        command
    }

    /// Runs a command to its end, which must be a good one.
    fn done(&self, line: &str) -> Result<Duration, String> {
        let begun = Instant::now();
        let output = self.command(line).output().map_err(|e| format!("gpsindy {line}: {e}"))?;
        expect(output.status.success(), || format!("gpsindy {line}: {}", complaint(&output)))?;
        Ok(begun.elapsed())
    }

    /// Runs a command and kills it after a part of the time that it takes.
    fn kill(&self, line: &str, length: Duration, rng: &mut ChaCha8Rng) -> Result<(), String> {
        let part = (rng.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        let mut child = self.command(line).spawn().map_err(|e| format!("gpsindy {line}: {e}"))?;
        std::thread::sleep(length.mul_f64(1.1 * part));
        // One that is done already is as good.
        let _ = child.kill();
        child.wait().map(drop).map_err(|e| format!("gpsindy {line}: {e}"))
    }

    fn diagnosis(confidence: &str, out: &str) -> String {
        format!(
            "diagnose slider.toml unit_0_0.csv unit_0_1.csv unit_0_2.csv --holdout unit_0_3.csv --effects quadratic_drag,bias --confidence {confidence} --out {out} --quiet"
        )
    }

    fn kill_diagnoses(&self, rng: &mut ChaCha8Rng) -> Result<(), String> {
        let mut length = Duration::ZERO;
        for confidence in CONFIDENCES {
            length = self.done(&Self::diagnosis(confidence, &format!("whole_{confidence}")))?;
        }
        let first = Self::diagnosis(CONFIDENCES[0], "killed");
        self.done(&first)?;
        let mut between = 0;
        for k in 0..KILLS {
            self.kill(&Self::diagnosis(CONFIDENCES[(k + 1) % 2], "killed"), length, rng)?;
            if !self.is_one_report("killed")? {
                between += 1;
                self.done(&first)?;
            }
        }
        // The last moments of a set are several renames, and no file system makes one of them.
        shell::say(&format!(
            "faults: {between} of {KILLS} kills fell between the renames of a report: files of two reports\n"
        ));
        self.tell("diagnose", "killed")
    }

    /// Whether the files of a report are of one of the two diagnoses; each of them must be whole.
    fn is_one_report(&self, out: &str) -> Result<bool, String> {
        let json = self.read(&format!("{out}/report.json"))?;
        let model = self.read(&format!("{out}/augmented.toml"))?;
        let page = self.read(&format!("{out}/report.html"))?;
        let mut is_one = false;
        let mut whole = [false; 3];
        for confidence in CONFIDENCES {
            let here = [
                json == self.read(&format!("whole_{confidence}/report.json"))?,
                model == self.read(&format!("whole_{confidence}/augmented.toml"))?,
                page.trim_end().ends_with("</html>") && page.contains(&format!("--confidence {confidence} ")),
            ];
            is_one |= here == [true; 3];
            whole.iter_mut().zip(here).for_each(|(whole, here)| *whole |= here);
        }
        expect(whole == [true; 3], || format!("{out}: a file is not whole"))?;
        Ok(is_one)
    }

    fn kill_identifications(&self, rng: &mut ChaCha8Rng) -> Result<(), String> {
        let line = |degree: usize, out: &str| {
            format!("identify unit_0_0.csv unit_0_1.csv --state v --degree {degree} --accept-poor --out {out} --quiet")
        };
        let length = self.done(&line(2, "model_2.toml"))?;
        self.done(&line(3, "model_3.toml"))?;
        self.done(&line(2, "killed.toml"))?;
        let whole = [self.read("model_2.toml")?, self.read("model_3.toml")?];
        for k in 0..KILLS {
            self.kill(&line(2 + (k + 1) % 2, "killed.toml"), length, rng)?;
            let found = self.read("killed.toml")?;
            expect(whole.contains(&found), || "killed.toml: not whole".into())?;
        }
        self.tell("identify", ".")
    }

    fn kill_fleets(&self, rng: &mut ChaCha8Rng) -> Result<(), String> {
        let line =
            |out: &str, part: &str| format!("fleet fleet.toml --out {out} --effects quadratic_drag,bias --quiet{part}");
        let length = self.done(&line("fleet_whole", ""))?;
        for k in 0..KILLS {
            // The whole fleet, and one of its two workers next to another.
            let part = ["", " --shard 1/2", " --shard 2/2"][k % 3];
            if k % 5 == 0 {
                let _ = fs::remove_dir_all(self.folder.join("fleet_killed"));
            }
            self.kill(&line("fleet_killed", part), length, rng)?;
            self.check_tasks("fleet_killed")?;
        }
        // What was lost is done again, and nothing else differs.
        self.done(&line("fleet_killed", ""))?;
        expect(self.read("fleet_killed/fleet.json")? == self.read("fleet_whole/fleet.json")?, || {
            "fleet.json after kills is not the one without".into()
        })?;
        self.tell("fleet", "fleet_killed")
    }

    /// Every report of a fleet is whole, and is the one of the fleet that nobody killed.
    fn check_tasks(&self, out: &str) -> Result<(), String> {
        let Ok(tasks) = fs::read_dir(self.folder.join(out).join("tasks")) else { return Ok(()) };
        for task in tasks.flatten() {
            let name = task.file_name().to_string_lossy().into_owned();
            for file in ["report.json", "report.html", "augmented.toml"] {
                let found = fs::read_to_string(task.path().join(file));
                let whole = self.read(&format!("fleet_whole/tasks/{name}/{file}"))?;
                expect(found.map_or(true, |found| found == whole), || format!("{out}/tasks/{name}/{file}: not whole"))?;
            }
            let is_done = task.path().join("report.json").is_file();
            let files = ["report.html", "augmented.toml"];
            expect(!is_done || files.iter().all(|file| task.path().join(file).is_file()), || {
                format!("{out}/tasks/{name}: done without all of its files")
            })?;
        }
        Ok(())
    }

    /// A disk that is full behind so many bytes: a limit of the size of a file replaces it, as it needs no disk of its own.
    fn lack_room(&self) -> Result<(), String> {
        if !cfg!(unix) {
            shell::say("faults: no limit of file sizes here, so none was tried\n");
            return Ok(());
        }
        self.done(&Self::diagnosis(CONFIDENCES[0], "full"))?;
        let names = names(&self.folder.join("full"));
        for kilobytes in [0, 1, 2, 4, 8, 16, 32, 64] {
            let line = Self::diagnosis(CONFIDENCES[1], "full");
            let limited = format!("ulimit -f {kilobytes}; exec '{}' {line}", self.program.display());
            let mut shell = Command::new("bash");
            shell.args(["-c", &limited]).current_dir(&self.folder).stdin(Stdio::null());
            let output = shell.output().map_err(|e| format!("bash: {e}"))?;
            let is_one = self.is_one_report("full")?;
            expect(is_one, || format!("with {kilobytes} kB: files of two reports"))?;
            expect(output.status.success() || one_line(&output), || {
                format!("with {kilobytes} kB: {}", complaint(&output))
            })?;
            expect(self::names(&self.folder.join("full")) == names, || {
                format!("with {kilobytes} kB: a part was left")
            })?;
        }
        shell::say("faults: no room, 8 limits: each report whole\n");
        Ok(())
    }

    /// A disk that is full, and one for reading alone: a file system in memory, which a user may mount in a name space of its own.
    fn refuse_the_disk(&self) -> Result<(), String> {
        let disk = self.folder.join("disk");
        fs::create_dir_all(&disk).map_err(|e| format!("{}: {e}", disk.display()))?;
        let mut may = Command::new("unshare");
        may.args(["--map-root-user", "--mount", "mount", "-t", "tmpfs", "none"]).arg(&disk).stderr(Stdio::null());
        if !may.status().is_ok_and(|status| status.success()) {
            shell::say("faults: no name space for a disk of its own here, so none was full or closed\n");
            return Ok(());
        }
        self.done(&Self::diagnosis(CONFIDENCES[0], "full"))?;
        let diagnosis = Self::diagnosis(CONFIDENCES[1], "disk/full");
        let mut refused = 0;
        for kilobytes in [900, 880, 860, 840, 820, 800, 780] {
            let fill = format!("dd if=/dev/zero of=disk/filling bs=1k count={kilobytes} status=none");
            refused += usize::from(!self.on_disk(&fill, &diagnosis)?);
        }
        expect(refused > 0, || "no disk was too full".into())?;
        shell::say(&format!("faults: a full disk, 7 times, {refused} of them too full: each report whole\n"));
        for line in [
            &diagnosis,
            &Self::diagnosis(CONFIDENCES[1], "disk/full/new"),
            "smooth unit_0_0.csv --state v --quiet --out disk/full/smooth.csv",
            "fleet fleet.toml --out disk/full/fleet --effects bias --quiet",
        ] {
            let is_done = self.on_disk("mount -o remount,ro disk", line)?;
            expect(!is_done, || format!("gpsindy {line}: done on a disk for reading alone"))?;
        }
        shell::say("faults: a disk for reading alone, 4 commands: one line each\n");
        Ok(())
    }

    /// Runs a command beside a report on a small disk that `change` has made worse, and says whether it did its work. Where it did not, it
    /// said so in one line; the report is a whole one, and nothing is left beside it.
    fn on_disk(&self, change: &str, line: &str) -> Result<bool, String> {
        let script = format!(
            "mount -t tmpfs -o size=1m none disk && cp -r full disk/ && {change}; '{}' {line}; status=$?; cp -r disk/full found; exit $status",
            self.program.display()
        );
        let mut shell = Command::new("unshare");
        shell.args(["--map-root-user", "--mount", "bash", "-c", &script]).current_dir(&self.folder);
        let output = shell.stdin(Stdio::null()).output().map_err(|e| format!("unshare: {e}"))?;
        let complained = |what: &str| format!("{change}; gpsindy {line}: {what}; {}", complaint(&output));
        expect(self.is_one_report("found")?, || complained("files of two reports"))?;
        let [found, full] = ["found", "full"].map(|folder| names(&self.folder.join(folder)));
        expect(found == full, || complained("a part was left"))?;
        expect(output.status.success() || one_line(&output), || complained("not one line"))?;
        fs::remove_dir_all(self.folder.join("found")).map_err(|e| format!("found: {e}"))?;
        Ok(output.status.success())
    }

    /// Nobody reads what is printed: neither an error nor a word.
    fn close_the_pipe(&self) -> Result<(), String> {
        for line in ["effects", "man", "export slider.toml --to c", "smooth unit_0_0.csv --state v --quiet"] {
            let mut command = self.command(line);
            let mut child = command.stdout(Stdio::piped()).spawn().map_err(|e| format!("gpsindy {line}: {e}"))?;
            drop(child.stdout.take());
            let output = child.wait_with_output().map_err(|e| format!("gpsindy {line}: {e}"))?;
            expect(output.status.success() && output.stderr.is_empty(), || {
                format!("gpsindy {line}: {}", complaint(&output))
            })?;
        }
        shell::say("faults: a closed pipe, 4 commands: silent\n");
        Ok(())
    }

    /// Two runs into one folder at a time: one of both reports is there in the end.
    fn share_a_folder(&self) -> Result<(), String> {
        for _ in 0..10 {
            let start =
                |confidence| self.command(&Self::diagnosis(confidence, "shared")).spawn().map_err(|e| e.to_string());
            let children = [start(CONFIDENCES[0])?, start(CONFIDENCES[1])?];
            for child in children {
                let output = child.wait_with_output().map_err(|e| e.to_string())?;
                expect(output.status.success(), || complaint(&output))?;
            }
            expect(self.is_one_report("shared")?, || "shared: files of two reports".into())?;
            expect(parts(&self.folder.join("shared")) == 0, || "shared: a part was left".into())?;
        }
        shell::say("faults: two runs into one folder, 10 times: one report each time\n");
        Ok(())
    }

    /// Says how many hidden parts the kills left, which is all that they may leave.
    fn tell(&self, command: &str, folder: &str) -> Result<(), String> {
        let left = parts(&self.folder.join(folder));
        shell::say(&format!("faults: {command} killed {KILLS} times: every file whole, {left} hidden parts left\n"));
        Ok(())
    }
}

/// `v' = -0.2*v - drag*v^2` from `start` in closed form, with a small error that needs no seed.
fn coast(start: f64, drag: f64) -> String {
    let mut text = String::from("t [s],v [m/s]\n");
    for i in 0..80 {
        let t = 0.05 * f64::from(i);
        let decay = (-0.2 * t).exp();
        let v = start * decay / (1.0 + start * drag / 0.2 * (1.0 - decay));
        text += &format!("{t:.2},{:.5}\n", v + 0.004 * (f64::from(i * i) * 1.7 + start).sin());
    }
    text
}

fn expect(holds: bool, otherwise: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(otherwise()) }
}

fn complaint(output: &Output) -> String {
    format!("{}, {:?}", output.status, String::from_utf8_lossy(&output.stderr))
}

/// Whether a failure was reported in one line and with a status of its own.
fn one_line(output: &Output) -> bool {
    let stated = String::from_utf8_lossy(&output.stderr);
    output.status.code() == Some(1) && stated.starts_with("error: ") && stated.lines().count() == 1
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Temporary files in a folder and those below it.
fn parts(folder: &Path) -> usize {
    let below = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    below
        .map(
            |path| {
                if path.is_dir() { parts(&path) } else { usize::from(path.extension().is_some_and(|e| e == "part")) }
            },
        )
        .sum()
}
