//! Output files appear whole or not at all.

use crate::error::{Error, Result};
use std::ffi::{OsStr, OsString};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Held while a file is written.
static WRITING: Mutex<()> = Mutex::new(());

/// Writes a file by way of a temporary one beside it, which is then renamed.
///
/// # Errors
/// [`Error::Write`]; the temporary file is removed then and an older file stays as it was.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |source| Error::Write { file: path.display().to_string(), source };
    let Some(name) = path.file_name() else {
        return Err(Error::file(&path.display().to_string(), "not a file's name"));
    };
    let part = path.with_file_name(part_name(name));
    let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let written = std::fs::File::create(&part)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&part, path));
    written.map_err(|source| {
        let _ = std::fs::remove_file(&part);
        failed(source)
    })
}

/// A hidden name that no other writer has: processes of two computers that share a disk may have the same number, so it is drawn.
fn part_name(name: &OsStr) -> OsString {
    // The keys of a new state are from the random numbers of the system.
    let drawn = RandomState::new().build_hasher().finish();
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{drawn:016x}.part"));
    hidden
}

/// Waits for a file that [`write_whole`] is writing, and lets none begin: for a process that is about to end.
pub fn finish_writing() {
    std::mem::forget(WRITING.lock().unwrap_or_else(PoisonError::into_inner));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_old_file_is_replaced_and_nothing_else_is_left() {
        let folder = std::env::temp_dir().join(format!("gpsindy-output-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("model.toml");
        write_whole(&path, b"old").unwrap();
        write_whole(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
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
}
