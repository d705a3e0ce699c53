//! Chunks: their heads, and their records unpacked.

use super::records::{self, Found};
use super::window::Window;
use crc32fast::Hasher;
use mcap::{McapError, McapResult};
use std::io::{self, BufRead, ErrorKind, Read, Take};
use zstd::zstd_safe::{DCtx, ResetDirective};

/// Bytes of a chunk's head besides the name of its packing, and where the length of that name is.
const HEAD: usize = 40;
const NAME: usize = 28;

/// Longest name of a packing.
const LONGEST: usize = 64;

/// The head of a chunk.
#[derive(Debug)]
struct Head {
    packing: String,
    /// Bytes in the file, and unpacked.
    packed: u64,
    unpacked: u64,
    /// Of the unpacked bytes; zero where the writer made none.
    checksum: u32,
    /// Bytes of the record behind the packed ones.
    padding: u64,
}

/// What is kept from chunk to chunk.
pub(super) struct Tools {
    buffer: Vec<u8>,
    zstd: Option<DCtx<'static>>,
}

impl Tools {
    /// Tools with a buffer of this size.
    pub(super) fn new(buffer: usize) -> Self {
        Self { buffer: vec![0; buffer], zstd: None }
    }
}

/// Hands the records of a chunk of `length` bytes, of at most `most` bytes each, to `take`, and leaves the file behind it.
///
/// The checksum is compared behind the last record: a chunk may be longer than what fits in memory.
///
/// # Errors
/// What `take` returns; a chunk that breaks off, can't be unpacked or has another checksum.
pub(super) fn read<R: Read, E: From<McapError>>(
    file: &mut Window<R>,
    length: u64,
    most: u64,
    tools: &mut Tools,
    mut take: impl FnMut(u8, &[u8]) -> Result<(), E>,
) -> Result<(), E> {
    let head = Head::read(file, length)?;
    let mut packed = file.by_ref().take(head.packed);
    let source = head.source(&mut packed, &mut tools.zstd)?;
    let hasher = (head.checksum != 0).then(Hasher::new);
    let mut window = Window::new(source.take(head.unpacked), std::mem::take(&mut tools.buffer), hasher);
    let mut left = head.unpacked;
    while left > 0 {
        match records::next(&mut window, &mut left, most)? {
            Found::Record(opcode, length) => take(opcode, window.cut(length))?,
            Found::Other(_, length) => records::skip(&mut window, length)?,
            Found::End => return Err(McapError::UnexpectedEof.into()),
        }
    }
    let (buffer, calculated) = window.close();
    tools.buffer = buffer;
    let saved = head.checksum;
    if let Some(calculated) = calculated.filter(|calculated| *calculated != saved) {
        return Err(McapError::BadChunkCrc { saved, calculated }.into());
    }
    // Some writers add bytes behind the last packed ones.
    let rest = packed.limit() + head.padding;
    Ok(records::skip(file, rest)?)
}

impl Head {
    fn read<R: Read>(file: &mut Window<R>, length: u64) -> McapResult<Self> {
        let short = |header: usize| McapError::BadChunkLength { header: header as u64, available: length };
        if length < HEAD as u64 {
            return Err(short(HEAD));
        }
        records::load(file, HEAD)?;
        let name = four(&file.at_hand()[NAME..]) as usize;
        if name > LONGEST {
            return Err(McapError::UnsupportedCompression(format!("a name of {name} bytes")));
        }
        let end = HEAD + name;
        let behind = length.checked_sub(end as u64).ok_or_else(|| short(end))?;
        records::load(file, end)?;
        let head = file.cut(end);
        let packing = String::from_utf8_lossy(&head[NAME + 4..end - 8]).into_owned();
        let packed = eight(&head[end - 8..]);
        Ok(Self {
            // What is not packed has one length.
            unpacked: if packing.is_empty() { packed } else { eight(&head[16..]) },
            checksum: four(&head[24..]),
            padding: behind.checked_sub(packed).ok_or(McapError::UnexpectedEoc)?,
            packing,
            packed,
        })
    }

    /// The unpacked bytes.
    fn source<'a, R: BufRead>(
        &self,
        packed: &'a mut Take<R>,
        zstd: &'a mut Option<DCtx<'static>>,
    ) -> McapResult<Box<dyn Read + 'a>> {
        Ok(match self.packing.as_str() {
            "" => Box::new(packed),
            "zstd" => {
                let context = zstd.get_or_insert_with(DCtx::create);
                // The chunk before may have had more than it said.
                let reset = context.reset(ResetDirective::SessionOnly);
                reset.map_err(|_| McapError::DecompressionError("zstd does not begin anew".into()))?;
                Box::new(zstd::stream::read::Decoder::with_context(packed, context))
            }
            "lz4" => Box::new(Lz4(Some(lz4::Decoder::new(packed).map_err(records::broken)?))),
            other => return Err(McapError::UnsupportedCompression(other.into())),
        })
    }
}

/// Frames of lz4, one behind the other: its reader ends with the first.
struct Lz4<R>(Option<lz4::Decoder<R>>);

impl<R: BufRead> Read for Lz4<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        while let Some(frame) = &mut self.0 {
            let count = frame.read(bytes)?;
            if count > 0 || bytes.is_empty() {
                return Ok(count);
            }
            let Some((mut packed, ended)) = self.0.take().map(lz4::Decoder::finish) else { break };
            if ended.is_err() {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            if !packed.fill_buf()?.is_empty() {
                self.0 = Some(lz4::Decoder::new(packed)?);
            }
        }
        Ok(0)
    }
}

/// The first four bytes as a number.
fn four(bytes: &[u8]) -> u32 {
    bytes.first_chunk().map_or(0, |first| u32::from_le_bytes(*first))
}

/// The first eight bytes as a number.
fn eight(bytes: &[u8]) -> u64 {
    bytes.first_chunk().map_or(0, |first| u64::from_le_bytes(*first))
}
