//! The source of the bytes of a log and their format, which is recognised by content, not by name.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A file, or bytes in memory; it can be read again from its begin.
#[derive(Debug, Clone)]
pub(crate) struct Input {
    /// As the user named it.
    pub(crate) file: String,
    place: Place,
}

#[derive(Debug, Clone)]
enum Place {
    Path(PathBuf),
    Memory(Arc<[u8]>),
    /// Bytes that come in pieces of random sizes, as from a pipe or over a network.
    #[cfg(test)]
    Pieces(Arc<[u8]>, u64),
}

/// Bytes that can be read at any place.
pub(crate) trait Bytes: Read + Seek + Send {}
impl<T: Read + Seek + Send> Bytes for T {}

/// What a log is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Mcap,
    Parquet,
    Ulog,
    /// Text, as far as the first bytes show.
    Csv,
}

impl Input {
    pub(crate) fn of_path(path: &Path) -> Self {
        Self { file: path.display().to_string(), place: Place::Path(path.into()) }
    }

    pub(crate) fn of_bytes(file: &str, bytes: &[u8]) -> Self {
        Self { file: file.into(), place: Place::Memory(bytes.into()) }
    }

    /// Opens it at its begin.
    pub(crate) fn open(&self) -> Result<Box<dyn Bytes>> {
        match &self.place {
            Place::Path(path) => Ok(Box::new(File::open(path).map_err(|e| self.failed(e))?)),
            Place::Memory(bytes) => Ok(Box::new(Cursor::new(Arc::clone(bytes)))),
            #[cfg(test)]
            Place::Pieces(bytes, seed) => Ok(Box::new(tests::Pieces::new(bytes, *seed))),
        }
    }

    /// The file, where it is one.
    #[cfg(feature = "parquet")]
    pub(crate) fn as_file(&self) -> Result<Option<File>> {
        match &self.place {
            Place::Path(path) => Ok(Some(File::open(path).map_err(|e| self.failed(e))?)),
            _ => Ok(None),
        }
    }

    /// All of its bytes.
    #[cfg(feature = "parquet")]
    pub(crate) fn bytes(&self) -> Result<Vec<u8>> {
        match &self.place {
            Place::Path(path) => std::fs::read(path).map_err(|e| self.failed(e)),
            Place::Memory(bytes) => Ok(bytes.to_vec()),
            #[cfg(test)]
            Place::Pieces(bytes, _) => Ok(bytes.to_vec()),
        }
    }

    /// Its length in bytes.
    pub(crate) fn len(&self) -> Result<u64> {
        match &self.place {
            Place::Path(path) => Ok(std::fs::metadata(path).map_err(|e| self.failed(e))?.len()),
            Place::Memory(bytes) => Ok(bytes.len() as u64),
            #[cfg(test)]
            Place::Pieces(bytes, _) => Ok(bytes.len() as u64),
        }
    }

    pub(crate) fn failed(&self, source: std::io::Error) -> Error {
        Error::Read { file: self.file.clone(), source }
    }

    /// The format by the first bytes.
    ///
    /// # Errors
    /// A file that can't be read, or one of a format that is known and not read, with the way out.
    pub(crate) fn kind(&self) -> Result<Kind> {
        let mut head = Vec::new();
        self.open()?.take(64).read_to_end(&mut head).map_err(|e| self.failed(e))?;
        if let Some((_, kind)) = READ.iter().find(|(magic, _)| head.starts_with(magic)) {
            return Ok(*kind);
        }
        match REFUSED.iter().find(|(magic, _)| head.starts_with(magic)) {
            Some((_, remedy)) => Err(Error::file(&self.file, *remedy)),
            None => Ok(Kind::Csv),
        }
    }
}

const READ: &[(&[u8], Kind)] =
    &[(b"\x89MCAP", Kind::Mcap), (b"PAR1", Kind::Parquet), (b"ULog\x01\x12\x35", Kind::Ulog)];

const REFUSED: &[(&[u8], &str)] = &[
    (
        b"#ROSBAG V",
        "a ROS 1 bag; convert it with `mcap convert`, or read it in Python with gpsindy.read_log and the extra gpsindy[rosbags]",
    ),
    (
        b"SQLite format 3",
        "a SQLite file, most likely a ROS 2 bag (.db3); convert it with `mcap convert`, or read it in Python with \
         gpsindy.read_log and the extra gpsindy[rosbags]",
    ),
    (
        b"\x89HDF",
        "an HDF5 file, also MATLAB's 7.3; read it in Python with h5py and hand in the arrays, or save it as CSV",
    ),
    (b"MATLAB 5.0", "a MATLAB file; read it in Python with scipy.io.loadmat and hand in the arrays, or save it as CSV"),
    (b"MDF     ", "an MDF file; read it in Python with asammdf and hand in the frame, or export it as CSV or Parquet"),
    (b"PK\x03\x04", "a ZIP archive (also .xlsx, .npz); unpack it or save it as CSV"),
    (b"\x1f\x8b", "packed with gzip; unpack it first"),
    (b"\x28\xb5\x2f\xfd", "packed with zstd; unpack it first"),
    (b"ARROW1", "an Arrow or Feather file; save it as Parquet, or hand in the frame in Python"),
];

#[cfg(test)]
mod tests;
