//! The leaves of a Parquet schema, and their values as numbers or text.

use super::arrow;
use super::footer::is_broken;
use super::guard::guarded;
use crate::error::{Error, Result};
use crate::input::Input;
use bytes::Bytes;
use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray, Int96};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

/// [`Leaf::kind`] of text.
pub(crate) const TEXT: &str = "text";

/// Records that are decoded at a time.
const BATCH: usize = 8_192;

/// An open table.
pub(crate) struct Table {
    file: String,
    reader: Box<dyn FileReader>,
}

/// A column of the file: a number, a text, or a list of them in each row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Leaf {
    pub(crate) index: usize,
    /// Its path with points, without what a list wraps around its elements.
    pub(crate) name: String,
    /// Its type, for people.
    pub(crate) kind: String,
    pub(crate) number: bool,
    pub(crate) listed: bool,
    unsigned: bool,
    /// Whether its values are whole numbers.
    pub(crate) whole: bool,
    /// Of a stamp, a time of the day or a date: the factor and the divisor that make seconds of its values.
    pub(crate) seconds: Option<(f64, f64)>,
}

/// Numbers row by row; a row of a list has several.
#[derive(Debug, Default)]
pub(crate) struct Rows {
    values: Vec<f64>,
    /// Of a list: where each row begins.
    begins: Option<Vec<usize>>,
}

impl Rows {
    pub(crate) fn len(&self) -> usize {
        self.begins.as_ref().map_or(self.values.len(), Vec::len)
    }

    /// An element of a row, NaN where the row has none.
    pub(crate) fn value(&self, row: usize, element: usize) -> f64 {
        let Some(begins) = &self.begins else { return self.values[row] };
        let end = begins.get(row + 1).copied().unwrap_or(self.values.len());
        let at = begins[row] + element;
        if at < end { self.values[at] } else { f64::NAN }
    }

    fn longest(&self) -> usize {
        let Some(begins) = &self.begins else { return 1 };
        let ends = begins.iter().skip(1).copied().chain([self.values.len()]);
        begins.iter().zip(ends).map(|(a, b)| b - a).max().unwrap_or(0)
    }
}

impl Table {
    pub(crate) fn open(input: &Input) -> Result<Self> {
        let failed = |e: ParquetError| broken(&input.file, &e);
        if is_broken(input)? {
            return Err(failed(ParquetError::General("its footer is broken".into())));
        }
        let reader: Box<dyn FileReader> = match input.as_file()? {
            Some(file) => Box::new(guarded(|| SerializedFileReader::new(file)).map_err(failed)?),
            None => {
                let bytes = Bytes::from(input.bytes()?);
                Box::new(guarded(|| SerializedFileReader::new(bytes)).map_err(failed)?)
            }
        };
        check(reader.as_ref(), input.len()?).map_err(|cause| broken(&input.file, &ParquetError::General(cause)))?;
        Ok(Self { file: input.file.clone(), reader })
    }

    pub(crate) fn leaves(&self) -> Vec<Leaf> {
        let metadata = self.reader.metadata().file_metadata();
        let columns = metadata.schema_descr().columns().iter().enumerate();
        let mut leaves: Vec<Leaf> = columns.filter_map(|(index, column)| Leaf::of(index, column)).collect();
        let notes = metadata.key_value_metadata().into_iter().flatten();
        let arrow = notes.filter(|note| note.key == arrow::KEY).find_map(|note| note.value.as_deref());
        for (name, ticks) in arrow.map(arrow::durations).unwrap_or_default() {
            let is_it = |leaf: &&mut Leaf| leaf.name == name && leaf.whole && leaf.seconds.is_none();
            if let Some(leaf) = leaves.iter_mut().find(is_it) {
                (leaf.kind, leaf.seconds) = ("duration".into(), Some((1.0, ticks)));
            }
        }
        leaves
    }

    /// The longest list among the first rows.
    pub(crate) fn width(&self, leaf: &Leaf) -> Result<usize> {
        let mut rows = Rows { begins: Some(Vec::new()), ..Rows::default() };
        self.each(leaf, 1, &mut |value| rows.take(value))?;
        Ok(rows.longest())
    }

    /// All numbers of a leaf.
    pub(crate) fn numbers(&self, leaf: &Leaf) -> Result<Rows> {
        let mut rows = Rows { begins: leaf.listed.then(Vec::new), ..Rows::default() };
        self.each(leaf, usize::MAX, &mut |value| rows.take(value))?;
        Ok(rows)
    }

    /// All integers of a leaf, the smallest where one is missing.
    pub(crate) fn integers(&self, leaf: &Leaf) -> Result<Vec<i64>> {
        let mut all = Vec::new();
        self.each(leaf, usize::MAX, &mut |value| {
            all.push(match value {
                Value::Integer { value, .. } => value,
                _ => i64::MIN,
            });
        })?;
        Ok(all)
    }

    /// The values of a leaf as text.
    pub(crate) fn texts(&self, leaf: &Leaf) -> Result<Vec<String>> {
        let mut all = Vec::new();
        self.each(leaf, usize::MAX, &mut |value| {
            all.push(match value {
                Value::Integer { value, .. } => value.to_string(),
                Value::Number { value, .. } => value.to_string(),
                Value::Text(text) => String::from_utf8_lossy(text).into_owned(),
                Value::Missing { .. } | Value::NoElement => String::new(),
            });
        })?;
        Ok(all)
    }

    /// Hands over the values of a leaf in order, of the first `groups` groups of rows.
    fn each(&self, leaf: &Leaf, groups: usize, take: &mut dyn FnMut(Value<'_>)) -> Result<()> {
        guarded(|| self.decode(leaf, groups, take)).map_err(|e| broken(&self.file, &e))
    }

    fn decode(
        &self,
        leaf: &Leaf,
        groups: usize,
        take: &mut dyn FnMut(Value<'_>),
    ) -> std::result::Result<(), ParquetError> {
        let column = self.reader.metadata().file_metadata().schema_descr().column(leaf.index);
        let shape = Shape {
            most_defined: column.max_def_level(),
            listed: column.max_rep_level() > 0,
            optional: column.self_type().is_optional(),
        };
        for group in 0..self.reader.num_row_groups().min(groups) {
            let group = self.reader.get_row_group(group)?;
            let unsigned = leaf.unsigned;
            match group.get_column_reader(leaf.index)? {
                ColumnReader::BoolColumnReader(r) => {
                    read(r, shape, take, &mut |v, first| Value::Integer { value: i64::from(*v), first, unsigned })
                }
                ColumnReader::Int32ColumnReader(r) => read(r, shape, take, &mut |v, first| {
                    let value = if unsigned { i64::from(*v as u32) } else { i64::from(*v) };
                    Value::Integer { value, first, unsigned }
                }),
                ColumnReader::Int64ColumnReader(r) => {
                    read(r, shape, take, &mut |v, first| Value::Integer { value: *v, first, unsigned })
                }
                ColumnReader::Int96ColumnReader(r) => read(r, shape, take, &mut |v: &Int96, first| Value::Integer {
                    value: v.to_nanos(),
                    first,
                    unsigned,
                }),
                ColumnReader::FloatColumnReader(r) => {
                    read(r, shape, take, &mut |v, first| Value::Number { value: f64::from(*v), first })
                }
                ColumnReader::DoubleColumnReader(r) => {
                    read(r, shape, take, &mut |v, first| Value::Number { value: *v, first })
                }
                ColumnReader::ByteArrayColumnReader(r) => {
                    read(r, shape, take, &mut |v: &ByteArray, _| Value::Text(if v.is_empty() { &[] } else { v.data() }))
                }
                ColumnReader::FixedLenByteArrayColumnReader(r) if leaf.number => {
                    read(r, shape, take, &mut |v: &FixedLenByteArray, first| Value::Number {
                        value: half(v.data()),
                        first,
                    })
                }
                _ => Err(ParquetError::General(format!("column {} is no number", leaf.name))),
            }?;
        }
        Ok(())
    }
}

/// Refuses places beyond the file, on which the parquet crate would panic.
fn check(reader: &dyn FileReader, length: u64) -> std::result::Result<(), String> {
    let metadata = reader.metadata();
    let columns = metadata.file_metadata().schema_descr().num_columns();
    for group in metadata.row_groups() {
        if group.num_columns() != columns {
            return Err("a group of rows lacks columns of the schema".into());
        }
        for column in group.columns() {
            let start = column.dictionary_page_offset().unwrap_or_else(|| column.data_page_offset());
            let end = start.checked_add(column.compressed_size()).and_then(|end| u64::try_from(end).ok());
            let inside = start >= 0 && column.data_page_offset() >= 0 && column.compressed_size() >= 0;
            if !inside || end.is_none_or(|end| end > length) || column.num_values() < 0 {
                return Err(format!("column {} lies outside the file", column.column_path().string()));
            }
        }
    }
    Ok(())
}

/// A value of a leaf; `first` where a row begins with it.
#[derive(Debug, Clone, Copy)]
enum Value<'a> {
    Integer {
        value: i64,
        first: bool,
        unsigned: bool,
    },
    Number {
        value: f64,
        first: bool,
    },
    Text(&'a [u8]),
    Missing {
        first: bool,
    },
    /// A row whose list is empty or missing.
    NoElement,
}

impl Rows {
    fn take(&mut self, value: Value<'_>) {
        let (number, first) = match value {
            Value::Integer { value, first, unsigned } => {
                (if unsigned { value as u64 as f64 } else { value as f64 }, first)
            }
            Value::Number { value, first } => (value, first),
            Value::Text(_) => (f64::NAN, true),
            Value::Missing { first } => (f64::NAN, first),
            Value::NoElement => {
                match &mut self.begins {
                    Some(begins) => begins.push(self.values.len()),
                    None => self.values.push(f64::NAN),
                }
                return;
            }
        };
        if let Some(begins) = self.begins.as_mut().filter(|_| first) {
            begins.push(self.values.len());
        }
        self.values.push(number);
    }
}

/// How levels mark what is missing.
#[derive(Debug, Clone, Copy)]
struct Shape {
    /// Level of a value that is there.
    most_defined: i16,
    listed: bool,
    /// Whether a single value may be missing.
    optional: bool,
}

fn read<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    shape: Shape,
    take: &mut dyn FnMut(Value<'_>),
    convert: &mut dyn for<'v> FnMut(&'v T::T, bool) -> Value<'v>,
) -> std::result::Result<(), ParquetError> {
    let Shape { most_defined, listed, optional } = shape;
    let (mut defined, mut repeated, mut values) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        defined.clear();
        repeated.clear();
        values.clear();
        let (records, _, levels) = reader.read_records(BATCH, Some(&mut defined), Some(&mut repeated), &mut values)?;
        if records == 0 && levels == 0 {
            return Ok(());
        }
        let mut next = values.iter();
        for i in 0..levels {
            let first = !listed || repeated.get(i).is_none_or(|r| *r == 0);
            let level = if most_defined == 0 { 0 } else { defined.get(i).copied().unwrap_or(0) };
            if level == most_defined {
                let Some(value) = next.next() else {
                    return Err(ParquetError::General("a column ends before its rows do".into()));
                };
                take(convert(value, first));
            } else if !listed || (optional && level == most_defined - 1) {
                take(Value::Missing { first });
            } else {
                take(Value::NoElement);
            }
        }
    }
}

impl Leaf {
    /// What a column is; `None` for lists of lists.
    fn of(index: usize, column: &ColumnDescriptor) -> Option<Self> {
        if column.max_rep_level() > 1 {
            return None;
        }
        let mut parts: Vec<&str> = column.path().parts().iter().map(String::as_str).collect();
        let listed = column.max_rep_level() == 1;
        if listed {
            for wrap in [&["list", "element"][..], &["list", "item"], &["bag", "array_element"], &["array"]] {
                if parts.len() > wrap.len() && parts.ends_with(wrap) {
                    parts.truncate(parts.len() - wrap.len());
                    break;
                }
            }
        }
        let kind = column.physical_type();
        let logical = column.logical_type_ref();
        let converted = column.converted_type();
        let ticks = |unit: TimeUnit| match unit {
            TimeUnit::MILLIS => 1e3,
            TimeUnit::MICROS => 1e6,
            TimeUnit::NANOS => 1e9,
        };
        // What a value is, and its seconds.
        let calendar = match (&logical, converted) {
            (Some(LogicalType::Timestamp(stamp)), _) => Some(("timestamp", (1.0, ticks(stamp.unit)))),
            (Some(LogicalType::Time(time)), _) => Some(("time of day", (1.0, ticks(time.unit)))),
            (Some(LogicalType::Date), _) | (None, ConvertedType::DATE) => Some(("date", (86_400.0, 1.0))),
            (None, ConvertedType::TIMESTAMP_MILLIS) => Some(("timestamp", (1.0, 1e3))),
            (None, ConvertedType::TIMESTAMP_MICROS) => Some(("timestamp", (1.0, 1e6))),
            (None, ConvertedType::TIME_MILLIS) => Some(("time of day", (1.0, 1e3))),
            (None, ConvertedType::TIME_MICROS) => Some(("time of day", (1.0, 1e6))),
            // What Spark and Impala write: nanoseconds of a day and the day.
            _ if kind == Physical::INT96 => Some(("timestamp", (1.0, 1e9))),
            _ => None,
        };
        let unsigned = matches!(&logical, Some(LogicalType::Integer(kind)) if !kind.is_signed)
            || matches!(
                converted,
                ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64
            );
        let decimal = matches!(&logical, Some(LogicalType::Decimal(_))) || converted == ConvertedType::DECIMAL;
        let whole = !decimal && matches!(kind, Physical::BOOLEAN | Physical::INT32 | Physical::INT64 | Physical::INT96);
        let is_half = matches!(&logical, Some(LogicalType::Float16)) && column.type_length() == 2;
        let number = !decimal && (whole || is_half || matches!(kind, Physical::FLOAT | Physical::DOUBLE));
        let named = match kind {
            _ if decimal => "decimals",
            _ if is_half => "float16",
            _ if calendar.is_some() => calendar.map_or("", |(name, _)| name),
            Physical::BOOLEAN => "bool",
            Physical::INT32 => {
                if unsigned {
                    "uint32"
                } else {
                    "int32"
                }
            }
            Physical::INT64 => {
                if unsigned {
                    "uint64"
                } else {
                    "int64"
                }
            }
            Physical::INT96 => "int96",
            Physical::FLOAT => "float32",
            Physical::DOUBLE => "float64",
            Physical::BYTE_ARRAY => TEXT,
            Physical::FIXED_LEN_BYTE_ARRAY => "bytes",
        };
        let (name, kind, seconds) = (parts.join("."), named.into(), calendar.map(|(_, seconds)| seconds));
        Some(Self { index, name, kind, number, listed, unsigned, whole, seconds })
    }
}

/// A number of half precision, low byte first.
fn half(bytes: &[u8]) -> f64 {
    bytes.try_into().map_or(f64::NAN, |bytes| half::f16::from_le_bytes(bytes).to_f64())
}

fn broken(file: &str, error: &ParquetError) -> Error {
    let words = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    Error::file(file, format!("the Parquet file is broken: {words}"))
}
