//! What is written where.

use super::*;

/// A folder that vanishes with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("gpsindy-output-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.at(name)).unwrap()
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn an_old_file_is_replaced_and_nothing_else_is_left() {
    let folder = Folder::new("old");
    write_whole(&folder.at("model.toml"), b"old").unwrap();
    write_whole(&folder.at("model.toml"), b"new").unwrap();
    assert_eq!((folder.read("model.toml"), folder.names()), ("new".into(), vec!["model.toml".into()]));
}

#[test]
fn a_set_is_replaced_whole_or_not_at_all() {
    let folder = Folder::new("set");
    for name in ["a", "b", "stale"] {
        write_whole(&folder.at(name), b"old").unwrap();
    }
    std::fs::create_dir(folder.at("taken")).unwrap();
    let stale = [folder.at("stale"), folder.at("never")];
    let new = |names: &[&str]| names.iter().map(|name| (folder.at(name), &b"new"[..])).collect::<Vec<_>>();
    // The last of them can't be written.
    let error = write_together(&new(&["a", "b", "taken"]), &stale).unwrap_err().to_string();
    assert!(error.ends_with("taken: cannot be written: it is a folder; name a file in it"), "{error}");
    assert_eq!((folder.read("a"), folder.read("b")), ("old".into(), "old".into()));
    assert_eq!(folder.names(), ["a", "b", "stale", "taken"]);
    write_together(&new(&["a", "b"]), &stale).unwrap();
    assert_eq!((folder.read("a"), folder.read("b")), ("new".into(), "new".into()));
    assert_eq!(folder.names(), ["a", "b", "taken"]);
}

#[cfg(unix)]
#[test]
fn a_set_waits_for_that_of_another_program_in_its_folder() {
    let folder = Folder::new("shared");
    let set = [(folder.at("a"), &b"new"[..]), (folder.at("b"), b"new")];
    // As the other program does while its files take their places; a lock of the same process by another opening is no other.
    let other = File::open(&folder.0).unwrap();
    other.lock().unwrap();
    std::thread::scope(|scope| {
        let writer = scope.spawn(|| write_together(&set, &[]));
        while folder.names().iter().filter(|name| name.ends_with(".part")).count() < 2 {
            std::thread::yield_now();
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
        assert!(!folder.at("a").exists() && !folder.at("b").exists());
        other.unlock().unwrap();
        writer.join().unwrap().unwrap();
    });
    assert_eq!(folder.names(), ["a", "b"]);
}

#[test]
fn a_file_without_write_permission_stays() {
    let folder = Folder::new("protected");
    write_whole(&folder.at("model.toml"), b"old").unwrap();
    let mut permissions = std::fs::metadata(folder.at("model.toml")).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(folder.at("model.toml"), permissions).unwrap();
    let error = write_whole(&folder.at("model.toml"), b"new").unwrap_err().to_string();
    assert!(error.ends_with("model.toml: cannot be written: permission denied"), "{error}");
    assert_eq!((folder.read("model.toml"), folder.names()), ("old".into(), vec!["model.toml".into()]));
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_its_target_is_written_with_its_permissions() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = Folder::new("link");
    std::fs::create_dir(folder.at("far")).unwrap();
    std::fs::write(folder.at("far/target"), "old").unwrap();
    std::fs::set_permissions(folder.at("far/target"), PermissionsExt::from_mode(0o640)).unwrap();
    symlink("far/target", folder.at("near")).unwrap();
    symlink("near", folder.at("nearer")).unwrap();
    symlink("far/none_yet", folder.at("dangling")).unwrap();
    symlink("circle", folder.at("circle")).unwrap();
    write_whole(&folder.at("nearer"), b"new").unwrap();
    assert!(folder.at("nearer").is_symlink() && folder.at("near").is_symlink());
    assert_eq!(folder.read("far/target"), "new");
    assert_eq!(std::fs::metadata(folder.at("far/target")).unwrap().permissions().mode() & 0o777, 0o640);
    write_whole(&folder.at("dangling"), b"new").unwrap();
    assert!(folder.at("dangling").is_symlink());
    assert_eq!(folder.read("far/none_yet"), "new");
    let error = write_whole(&folder.at("circle"), b"new").unwrap_err().to_string();
    assert!(error.ends_with("circle: cannot be written: a circle of symbolic links"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_pipe_and_a_device_are_written_to() {
    use std::os::unix::fs::FileTypeExt;
    let folder = Folder::new("pipe");
    let pipe = folder.at("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read_to_string(pipe).unwrap()
    });
    write_whole(&pipe, b"through").unwrap();
    assert!(std::fs::symlink_metadata(&pipe).unwrap().file_type().is_fifo(), "the pipe was replaced");
    assert_eq!(reader.join().unwrap(), "through");
    // A link, so that a fault replaces the link and not the machine's device.
    std::os::unix::fs::symlink("/dev/null", folder.at("null")).unwrap();
    write_whole(&folder.at("null"), b"into the void").unwrap();
    assert!(folder.at("null").is_symlink());
    assert!(std::fs::metadata("/dev/null").unwrap().file_type().is_char_device());
}

#[cfg(target_os = "linux")]
#[test]
fn an_open_descriptor_is_written_behind_what_stands_there() {
    use std::os::fd::AsRawFd;
    let folder = Folder::new("descriptor");
    let mut file = File::create(folder.at("out")).unwrap();
    file.write_all(b"first,").unwrap();
    let link = folder.at("stdout");
    std::os::unix::fs::symlink(format!("/proc/self/fd/{}", file.as_raw_fd()), &link).unwrap();
    write_whole(&link, b"second").unwrap();
    assert_eq!((folder.read("out"), folder.names()), ("first,second".into(), vec!["out".into(), "stdout".into()]));
}

#[test]
fn no_two_part_files_share_a_name() {
    let name = |_| part_name(OsStr::new("report.json")).into_string().unwrap();
    // A new thread draws its keys anew, as another process does.
    let drawn = move || (0..100).map(name).collect::<Vec<String>>();
    let threads: Vec<_> = (0..20).map(|_| std::thread::spawn(drawn)).collect();
    let names: Vec<String> = threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect();
    assert!(names.iter().all(|n| n.starts_with(".report.json.") && n.ends_with(".part")), "{names:?}");
    assert_eq!(names.iter().collect::<std::collections::HashSet<_>>().len(), 2000);
}

#[test]
fn a_folder_that_is_not_there_is_named() {
    let error = write_whole(Path::new("/no/such/folder/model.toml"), b"").unwrap_err();
    assert!(
        error.to_string().starts_with("/no/such/folder/model.toml: cannot be written: there is no such"),
        "{error}"
    );
}
