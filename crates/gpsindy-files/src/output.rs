//! Output files appear whole or not at all.

use crate::error::{Error, Result};
use std::ffi::OsString;
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
    let mut hidden = OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(hidden);
    let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    let written = std::fs::File::create(&part)
        .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&part, path));
    written.map_err(|source| {
        let _ = std::fs::remove_file(&part);
        failed(source)
    })
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
    fn a_folder_that_is_not_there_is_named() {
        let error = write_whole(Path::new("/no/such/folder/model.toml"), b"").unwrap_err();
        assert!(
            error.to_string().starts_with("/no/such/folder/model.toml: cannot be written: there is no such"),
            "{error}"
        );
    }
}
