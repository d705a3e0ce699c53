//! Where results go: a folder, or any other place that keeps files by name.

use gpsindy_files::{Error, Result, write_together};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// A place of files, each written whole or not at all. Names are relative, with `/` between their parts.
pub trait Store: Sync {
    /// The content of a file; none where there is no such file.
    ///
    /// # Errors
    /// A place that does not answer.
    fn read(&self, name: &str) -> Result<Option<Vec<u8>>>;

    /// Whether there is a file of this name.
    ///
    /// # Errors
    /// A place that does not answer.
    fn has(&self, name: &str) -> Result<bool>;

    /// Writes a file, so that a reader sees the old content or the new one and never a part.
    ///
    /// # Errors
    /// A place that does not take it.
    fn write(&self, name: &str, content: &[u8]) -> Result<()>;

    /// Writes files that belong together; where the place can, none is replaced before all of them are there.
    ///
    /// # Errors
    /// A place that does not take one of them.
    fn write_together(&self, files: &[(&str, &[u8])]) -> Result<()> {
        files.iter().try_for_each(|(name, content)| self.write(name, content))
    }

    /// Removes a file; one that is not there is as good.
    ///
    /// # Errors
    /// A place that does not answer.
    fn remove(&self, name: &str) -> Result<()>;

    /// The place of a file as a user knows it, for messages.
    fn place(&self, name: &str) -> String;
}

/// A folder of this machine or of a shared disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder(PathBuf);

impl Folder {
    /// The folder at a path, made with the first file.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

impl Store for Folder {
    fn read(&self, name: &str) -> Result<Option<Vec<u8>>> {
        match std::fs::read(self.0.join(name)) {
            Ok(content) => Ok(Some(content)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(source) => Err(Error::Read { file: self.place(name), source }),
        }
    }

    fn has(&self, name: &str) -> Result<bool> {
        Ok(self.0.join(name).is_file())
    }

    fn write(&self, name: &str, content: &[u8]) -> Result<()> {
        self.write_together(&[(name, content)])
    }

    fn write_together(&self, files: &[(&str, &[u8])]) -> Result<()> {
        let files: Vec<(PathBuf, &[u8])> = files.iter().map(|(name, content)| (self.0.join(name), *content)).collect();
        for (path, _) in &files {
            let folder = path.parent().unwrap_or(&self.0);
            let file = folder.display().to_string();
            std::fs::create_dir_all(folder).map_err(|source| Error::Write { file, source })?;
        }
        write_together(&files, &[])
    }

    fn remove(&self, name: &str) -> Result<()> {
        match std::fs::remove_file(self.0.join(name)) {
            Err(source) if source.kind() != ErrorKind::NotFound => Err(Error::Write { file: self.place(name), source }),
            _ => Ok(()),
        }
    }

    fn place(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_keeps_what_is_written_and_says_what_is_not_there() {
        let path = std::env::temp_dir().join(format!("gpsindy-store-{}", std::process::id()));
        let folder = Folder::new(&path);
        assert_eq!(folder.read("tasks/a/report.json").unwrap(), None);
        assert!(!folder.has("tasks/a/report.json").unwrap());
        folder.remove("tasks/a/report.json").unwrap();
        folder.write("tasks/a/report.json", b"{}").unwrap();
        assert!(folder.has("tasks/a/report.json").unwrap());
        assert_eq!(folder.read("tasks/a/report.json").unwrap().unwrap(), b"{}");
        folder.remove("tasks/a/report.json").unwrap();
        assert!(!folder.has("tasks/a/report.json").unwrap());
        // Of two files that belong together the second can't be written, so the first stays as it was.
        folder.write("fleet.html", b"old").unwrap();
        std::fs::create_dir(path.join("fleet.json")).unwrap();
        assert!(folder.write_together(&[("fleet.html", b"new"), ("fleet.json", b"new")]).is_err());
        assert_eq!(folder.read("fleet.html").unwrap().unwrap(), b"old");
        std::fs::remove_dir_all(path).unwrap();
    }
}
