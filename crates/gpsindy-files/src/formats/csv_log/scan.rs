//! Passes over a file: its header, then row after row, none of them kept.

use super::Row;
use super::headers::separator;
use crate::error::{Error, Result};
use crate::input::Input;
use csv::{ErrorKind, StringRecord};
use gpsindy_core::Progress;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};

/// Rows between two reports of progress.
const REPORT: u64 = 10_000;

/// Bytes that are read at a time.
const BUFFER: usize = 1 << 16;

/// Where the rows of a file are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body {
    /// Byte at which the header begins.
    header: u64,
    separator: u8,
}

/// The header row with its line, and where the rows are; `None` where the file holds nothing but comments.
///
/// # Errors
/// A file that can't be read or is not UTF-8.
pub(super) fn head(input: &Input) -> Result<Option<(Body, Row)>> {
    let mut bytes = BufReader::with_capacity(BUFFER, input.open()?);
    let (mut at, mut line) = (0_u64, 1_u64);
    let mut piece = Vec::new();
    loop {
        piece.clear();
        bytes.read_until(b'\n', &mut piece).map_err(|e| input.failed(e))?;
        if piece.is_empty() {
            return Ok(None);
        }
        if at == 0 && (piece.starts_with(&[0xff, 0xfe]) || piece.starts_with(&[0xfe, 0xff])) {
            return Err(Error::line(&input.file, 1, None, "the file is UTF-16; save it as UTF-8"));
        }
        let Ok(text) = std::str::from_utf8(&piece) else { return Err(not_utf8(input)) };
        let mark = if at == 0 && text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        let trimmed = text[mark..].trim();
        if trimmed.is_empty() || trimmed.starts_with('#') {
            at += piece.len() as u64;
            line += 1;
            continue;
        }
        let separator = separator(text[mark..].lines().next().unwrap_or_default());
        let body = Body { header: at + mark as u64, separator };
        let mut header = None;
        pass(input, body, &mut |_, row| {
            header = Some(Row { line, cells: row.cells.clone() });
            Ok(false)
        })?;
        return Ok(header.map(|header| (body, header)));
    }
}

/// Hands over the rows behind the header; `line` of each is the byte at which it begins.
///
/// # Errors
/// What `take` returns, with the line in place of the byte; a file that can't be read; a request to stop.
pub(super) fn rows(
    input: &Input,
    body: Body,
    progress: &dyn Progress,
    take: &mut dyn FnMut(&Row) -> Result<()>,
) -> Result<()> {
    let length = usize::try_from(input.len()?).unwrap_or(usize::MAX);
    pass(input, body, &mut |count, row| {
        if count == 0 {
            return Ok(true);
        }
        if count % REPORT == 0 && !progress.report("reading", row.line as usize, length) {
            return Err(gpsindy_core::Error::Cancelled.into());
        }
        match take(row) {
            Ok(()) => Ok(true),
            Err(Error::Line { file, line, column, message }) => {
                let line = line_of(input, line)?;
                Err(Error::Line { file, line, column, message })
            }
            Err(other) => Err(other),
        }
    })
}

/// Hands over the header and the rows until `take` says to stop.
fn pass(input: &Input, body: Body, take: &mut dyn FnMut(u64, &Row) -> Result<bool>) -> Result<()> {
    let mut bytes = input.open()?;
    bytes.seek(SeekFrom::Start(body.header)).map_err(|e| input.failed(e))?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(body.separator)
        .trim(csv::Trim::All)
        .buffer_capacity(BUFFER)
        .from_reader(bytes);
    let mut row = Row { line: 0, cells: StringRecord::new() };
    for count in 0.. {
        match reader.read_record(&mut row.cells) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                return Err(match error.into_kind() {
                    ErrorKind::Utf8 { .. } => not_utf8(input),
                    ErrorKind::Io(error) => input.failed(error),
                    _ => Error::file(&input.file, "not a CSV file"),
                });
            }
        }
        row.line = body.header + row.cells.position().map_or(0, csv::Position::byte);
        if !take(count, &row)? {
            break;
        }
    }
    Ok(())
}

/// The line of a row that begins at a byte, or behind the blank lines there: the csv crate's own count is of those.
pub(super) fn line_of(input: &Input, at: u64) -> Result<u64> {
    let mut bytes = BufReader::with_capacity(BUFFER, input.open()?);
    let (mut line, mut place) = (1, 0_u64);
    loop {
        let buffer = bytes.fill_buf().map_err(|e| input.failed(e))?;
        if buffer.is_empty() {
            return Ok(line);
        }
        for byte in buffer {
            if place >= at && !matches!(byte, b'\r' | b'\n') {
                return Ok(line);
            }
            line += u64::from(*byte == b'\n');
            place += 1;
        }
        let read = buffer.len();
        bytes.consume(read);
    }
}

/// The error for the first byte of a file that is no text.
fn not_utf8(input: &Input) -> Error {
    let mut bytes = Vec::new();
    let read = input.open().and_then(|mut file| file.read_to_end(&mut bytes).map_err(|e| input.failed(e)));
    if let Err(error) = read {
        return error;
    }
    let valid = std::str::from_utf8(&bytes).map_or_else(|e| e.valid_up_to(), str::len);
    let line = 1 + bytes[..valid].iter().filter(|b| **b == b'\n').count() as u64;
    let byte = bytes.get(valid).copied().unwrap_or_default();
    Error::line(&input.file, line, None, format!("byte 0x{byte:02x} is not UTF-8; save the file as UTF-8"))
}
