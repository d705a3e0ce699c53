//! What `--out` writes to and what it leaves alone.

use crate::common::Folder;
use crate::common::slider::{SLIDER, coast};

fn lab() -> Folder {
    let folder = Folder::new();
    folder.write("slider.toml", SLIDER);
    for (i, start) in [1.5, 2.5, 3.0, 2.0].into_iter().enumerate() {
        folder.write(&format!("run_{}.csv", i + 1), &coast(start, 0.3));
    }
    folder
}

const DIAGNOSE: &str = "run_1.csv run_2.csv run_3.csv --holdout run_4.csv --effects quadratic_drag,bias --out report";

#[test]
fn no_command_replaces_what_it_reads() {
    let folder = lab();
    folder.write("map.toml", "[map]\n");
    for arguments in [
        "smooth run_1.csv --out run_1.csv",
        "smooth run_1.csv run_2.csv --out ./run_2.csv",
        "smooth run_1.csv --map-file map.toml --out map.toml",
        "identify run_1.csv --state v --out run_1.csv",
        "identify run_1.csv --state v --holdout run_2.csv --out run_2.csv",
        "identify run_1.csv --state v --preset author --out run_1.csv",
        "identify run_1.csv --state v --follow --out run_1.csv",
        "simulate slider.toml --data run_1.csv --out slider.toml",
        "simulate slider.toml --data run_1.csv --out run_1.csv",
        "score slider.toml --data run_1.csv --out run_1.csv",
        "export slider.toml --to c --out slider.toml",
        "inspect run_1.csv --out run_1.csv",
        "design slider.toml slider.toml --noise v=1 --limit u=0:1 --out slider.toml",
    ] {
        let out = arguments.rsplit(' ').next().unwrap();
        let before = folder.read(out);
        let ran = folder.run(arguments);
        assert_eq!(ran.refused(), format!("--out: {out} is an input; name another file"), "{arguments}");
        assert_eq!(folder.read(out), before, "{arguments}");
    }
}

#[test]
fn a_diagnosis_does_not_replace_its_own_model() {
    let folder = lab();
    std::fs::create_dir(folder.path().join("report")).unwrap();
    let model = format!("# Written by gpsindy diagnose\n{SLIDER}");
    folder.write("report/augmented.toml", &model);
    for force in ["", " --force"] {
        let ran = folder.run(&format!("diagnose report/augmented.toml {DIAGNOSE}{force}"));
        assert_eq!(ran.refused(), "--out: report/augmented.toml is an input; name another file");
    }
    assert_eq!((folder.read("report/augmented.toml"), folder.names().len()), (model, 6));
}

#[test]
fn a_folder_is_no_file_to_write() {
    let folder = lab();
    let ran = folder.run("export slider.toml --to c --out .");
    assert_eq!(ran.refused(), "--out: . is a folder; name a file");
}

#[cfg(unix)]
mod unix {
    use super::*;
    use std::os::unix::fs::{FileTypeExt, symlink};
    use std::process::Command;

    #[test]
    fn another_name_of_an_input_is_the_input() {
        let folder = lab();
        symlink("run_1.csv", folder.path().join("link.csv")).unwrap();
        std::fs::hard_link(folder.path().join("run_1.csv"), folder.path().join("hard.csv")).unwrap();
        for out in ["link.csv", "hard.csv"] {
            let ran = folder.run(&format!("smooth run_1.csv --state v --out {out}"));
            assert_eq!(ran.refused(), format!("--out: {out} is an input; name another file"));
        }
        let shell = format!("'{}' smooth - --state v --out run_1.csv < run_1.csv", env!("CARGO_BIN_EXE_gpsindy"));
        let ran = Command::new("sh").args(["-c", &shell]).current_dir(folder.path()).output().unwrap();
        let stated = String::from_utf8(ran.stderr).unwrap();
        assert_eq!(stated, "error: --out: run_1.csv is an input; name another file\n");
        assert_eq!(folder.read("run_1.csv"), coast(1.5, 0.3));
    }

    #[test]
    fn a_pipe_is_written_to_and_a_link_followed() {
        let folder = lab();
        let pipe = folder.path().join("pipe");
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::read_to_string(pipe).unwrap()
        });
        folder.run("export slider.toml --to c --out pipe").done();
        assert!(std::fs::symlink_metadata(&pipe).unwrap().file_type().is_fifo(), "the pipe was replaced");
        let source = folder.run("export slider.toml --to c").done().stdout;
        assert_eq!(reader.join().unwrap(), source);
        folder.write("target.c", "old");
        symlink("target.c", folder.path().join("link.c")).unwrap();
        folder.run("export slider.toml --to c --out link.c").done();
        assert_eq!(folder.read("target.c"), source);
        assert!(folder.path().join("link.c").is_symlink());
    }

    #[test]
    fn a_full_device_is_one_line() {
        let folder = lab();
        symlink("/dev/full", folder.path().join("full")).unwrap();
        let ran = folder.run("export slider.toml --to c --out full");
        assert_eq!((ran.status, ran.stdout.as_str()), (1, ""));
        assert_eq!(ran.stderr, "error: full: cannot be written: No space left on device\n");
    }

    /// The limit is between the sizes of the two files, as a disk does that has room for the first alone.
    #[test]
    fn a_report_without_room_for_all_of_it_leaves_the_older_one() {
        let folder = lab();
        folder.run(&format!("diagnose slider.toml {DIAGNOSE} --quiet")).done();
        let read = || ["json", "html"].map(|kind| folder.read(&format!("report/report.{kind}")));
        let (before, names) = (read(), std::fs::read_dir(folder.path().join("report")).unwrap().count());
        let blocks = (before[0].len() + before[1].len()) / 2 / 1024;
        let shell = format!(
            "ulimit -f {blocks}; exec '{}' diagnose slider.toml {DIAGNOSE} --quiet --confidence 0.9",
            env!("CARGO_BIN_EXE_gpsindy")
        );
        let ran = Command::new("bash").args(["-c", &shell]).current_dir(folder.path()).output().unwrap();
        let stated = String::from_utf8(ran.stderr).unwrap();
        assert_eq!(stated, "error: report/report.html: cannot be written: File too large\n");
        assert_eq!(ran.status.code(), Some(1));
        assert_eq!(read(), before);
        assert_eq!(std::fs::read_dir(folder.path().join("report")).unwrap().count(), names, "a part was left");
    }
}

/// A limit on the size of files answers with a signal, which would end the program without a word.
#[cfg(unix)]
#[test]
fn a_file_that_may_not_grow_is_one_line_and_leaves_the_old_report_whole() {
    let folder = lab();
    folder.run(&format!("diagnose slider.toml {DIAGNOSE} --quiet")).done();
    let report = || {
        let names = std::fs::read_dir(folder.path().join("report")).unwrap().map(|e| e.unwrap().file_name());
        let mut files: Vec<_> = names.map(|name| name.to_string_lossy().into_owned()).collect();
        files.sort();
        files.into_iter().map(|name| (name.clone(), folder.read(&format!("report/{name}")))).collect::<Vec<_>>()
    };
    let before = report();
    // Blocks of 512 bytes, or of 1024: less than the page takes, more than the other files do.
    let line = format!("ulimit -f 24; exec {} diagnose slider.toml {DIAGNOSE} --quiet", env!("CARGO_BIN_EXE_gpsindy"));
    let ran = std::process::Command::new("sh").args(["-c", &line]).current_dir(folder.path()).output().unwrap();
    let said = String::from_utf8(ran.stderr).unwrap();
    assert_eq!(ran.status.code(), Some(1), "{said}");
    assert!(said.lines().count() == 1 && said.starts_with("error: report/"), "{said}");
    assert_eq!(report(), before);
}
