//! Output files appear whole or not at all, alone or as a set.

use crate::error::{Error, Result};
use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Held while files are written.
static WRITING: Mutex<()> = Mutex::new(());

/// Links that are followed from one name, as many as Linux follows.
const MOST_LINKS: usize = 40;

/// Bytes at the begin of a file that name its writer.
const START: u64 = 4096;

/// Writes a file by way of a temporary one next to it, which is then renamed.
///
/// A symbolic link stays and its target is replaced. What is no regular file (a pipe, a device, an open descriptor such as `/dev/stdout`)
/// is written to. An older file hands on its permissions.
///
/// # Errors
/// [`Error::Write`]; the temporary file is removed then and an older file stays as it was.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    write_together(&[(path.to_path_buf(), bytes)], &[])
}

/// Writes files that belong together, each as [`write_whole`] does, and removes the `stale` ones, which an earlier set had and this one
/// lacks. Nothing is replaced before every file is on the disk, so that a full disk leaves the earlier set, and two programs that write
/// into one folder replace their sets one after the other; only a kill or a power cut within the renames can leave files of both.
///
/// # Errors
/// [`Error::Write`]; no temporary file is left then.
pub fn write_together(files: &[(PathBuf, &[u8])], stale: &[PathBuf]) -> Result<()> {
    let mut streams = Vec::new();
    let mut staged = Vec::new();
    {
        let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        for (path, bytes) in files {
            match place(path).map_err(failed(path))? {
                Place::Stream => streams.push((path, bytes)),
                Place::File(target) => staged.push((path, Part::write(target, bytes).map_err(failed(path))?)),
            }
        }
        let _replacing = if files.len() + stale.len() > 1 { lock(&staged) } else { Vec::new() };
        for (path, part) in staged {
            part.commit().map_err(failed(path))?;
        }
        for path in stale {
            match std::fs::remove_file(path) {
                Err(source) if source.kind() != ErrorKind::NotFound => return Err(failed(path)(source)),
                _ => {}
            }
        }
    }
    // Without the lock: whoever reads a pipe may let it wait for ever, and the end of the process waits for the lock.
    for (path, bytes) in streams {
        let stream = OpenOptions::new().append(true).open(path);
        stream.and_then(|mut stream| stream.write_all(bytes)).map_err(failed(path))?;
    }
    Ok(())
}

/// Locks the folders of a set while it takes the place of another, which is moments. A system that has no locks of folders does without.
fn lock(staged: &[(&PathBuf, Part)]) -> Vec<File> {
    let mut folders: Vec<&Path> = staged.iter().filter_map(|(_, part)| part.target.parent()).collect();
    // In one order, so that no two programs wait for each other.
    folders.sort_unstable();
    folders.dedup();
    let opened = folders.into_iter().map(|folder| if folder == Path::new("") { Path::new(".") } else { folder });
    opened.filter_map(|folder| File::open(folder).ok()).filter(|folder| folder.lock().is_ok()).collect()
}

/// How a file begins, enough to know who wrote it; none where there is no such file. A pipe is none, and would let the reader wait.
pub fn start_of(path: &Path) -> Option<String> {
    let mut start = Vec::new();
    if !path.is_file() {
        return None;
    }
    File::open(path).ok()?.take(START).read_to_end(&mut start).ok()?;
    Some(String::from_utf8_lossy(&start).into_owned())
}

/// Waits for the files that [`write_together`] is writing, and lets none begin: for a process that is about to end.
pub fn finish_writing() {
    std::mem::forget(WRITING.lock().unwrap_or_else(PoisonError::into_inner));
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> Error {
    let file = path.display().to_string();
    |source| Error::Write { file, source }
}

/// What a name leads to.
enum Place {
    /// A regular file or none yet, its links followed.
    File(PathBuf),
    /// A pipe, a device or an open descriptor.
    Stream,
}

fn place(path: &Path) -> io::Result<Place> {
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        // An open descriptor may be that of a regular file, which whoever opened it goes on to write.
        if path.starts_with("/dev/fd") || path.starts_with("/proc") {
            return Ok(Place::Stream);
        }
        let kind = match std::fs::symlink_metadata(&path) {
            Ok(metadata) => metadata.file_type(),
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Place::File(path)),
            Err(error) => return Err(error),
        };
        if kind.is_dir() {
            return Err(ErrorKind::IsADirectory.into());
        }
        if kind.is_file() {
            return Ok(Place::File(path));
        }
        if !kind.is_symlink() {
            return Ok(Place::Stream);
        }
        let target = std::fs::read_link(&path)?;
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    Err(io::Error::other("a circle of symbolic links"))
}

/// A temporary file next to its target, removed unless it takes the target's place.
struct Part {
    file: PathBuf,
    target: PathBuf,
}

impl Part {
    fn write(target: PathBuf, bytes: &[u8]) -> io::Result<Self> {
        let name = target.file_name().ok_or_else(|| io::Error::other("not a file's name"))?;
        let older = std::fs::metadata(&target).ok().map(|metadata| metadata.permissions());
        if older.as_ref().is_some_and(std::fs::Permissions::readonly) {
            return Err(ErrorKind::PermissionDenied.into());
        }
        let part = Self { file: target.with_file_name(part_name(name)), target };
        let mut file = File::create(&part.file)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        if let Some(permissions) = older {
            file.set_permissions(permissions)?;
        }
        Ok(part)
    }

    fn commit(self) -> io::Result<()> {
        std::fs::rename(&self.file, &self.target)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // Not there any more where it took the target's place.
        let _ = std::fs::remove_file(&self.file);
    }
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

#[cfg(test)]
mod tests;
