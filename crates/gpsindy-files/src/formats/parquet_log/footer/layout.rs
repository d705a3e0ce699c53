//! What the format says of the fields of a footer: their numbers and kinds.
//!
//! Source: Apache Parquet, src/main/thrift/parquet.thrift, of the structs that the `parquet` crate knows.

/// The fields of a struct that have a meaning.
pub(super) type Struct = &'static [(u8, Kind)];

/// What a field holds.
pub(super) enum Kind {
    Truth,
    Byte,
    Number,
    Double,
    Bytes,
    List(&'static Self),
    Fields(Struct),
}

use Kind::{Byte, Bytes, Double, Fields, List, Number, Truth};

impl Kind {
    /// Whether the protocol writes it with this type. Numbers are written alike, whatever their width.
    pub(super) fn is_written_as(&self, kind: u8) -> bool {
        match self {
            Truth => matches!(kind, 1 | 2),
            Byte => kind == 3,
            Number => matches!(kind, 4..=6),
            Double => kind == 7,
            Bytes => kind == 8,
            List(_) => kind == 9,
            Fields(_) => kind == 12,
        }
    }

    /// What a list holds.
    pub(super) fn element(&self) -> Option<&'static Self> {
        if let List(element) = self { Some(element) } else { None }
    }

    /// The fields of a struct.
    pub(super) fn fields(&self) -> Struct {
        if let Fields(fields) = self { fields } else { &[] }
    }
}

/// The whole footer.
pub(super) const FILE: Struct = &[
    (1, Number),
    (2, List(&Fields(SCHEMA_ELEMENT))),
    (3, Number),
    (4, List(&Fields(ROW_GROUP))),
    (5, List(&Fields(KEY_VALUE))),
    (6, Bytes),
    (7, List(&EMPTY)),
    (8, EMPTY),
    (9, Bytes),
];

/// A union whose members hold nothing, or nothing that is read.
const EMPTY: Kind = Fields(&[]);

const SCHEMA_ELEMENT: Struct = &[
    (1, Number),
    (2, Number),
    (3, Number),
    (4, Bytes),
    (5, Number),
    (6, Number),
    (7, Number),
    (8, Number),
    (9, Number),
    (10, Fields(LOGICAL_TYPE)),
];

const LOGICAL_TYPE: Struct = &[
    (1, EMPTY),
    (2, EMPTY),
    (3, EMPTY),
    (4, EMPTY),
    (5, Fields(&[(1, Number), (2, Number)])),
    (6, EMPTY),
    (7, Fields(TIME)),
    (8, Fields(TIME)),
    (10, Fields(&[(1, Byte), (2, Truth)])),
    (11, EMPTY),
    (12, EMPTY),
    (13, EMPTY),
    (14, EMPTY),
    (15, EMPTY),
    (16, Fields(&[(1, Byte)])),
    (17, Fields(&[(1, Bytes)])),
    (18, Fields(&[(1, Bytes), (2, Number)])),
];

const TIME: Struct = &[(1, Truth), (2, Fields(&[(1, EMPTY), (2, EMPTY), (3, EMPTY)]))];

const ROW_GROUP: Struct = &[
    (1, List(&Fields(COLUMN_CHUNK))),
    (2, Number),
    (3, Number),
    (4, List(&Fields(&[(1, Number), (2, Truth), (3, Truth)]))),
    (5, Number),
    (6, Number),
    (7, Number),
];

const COLUMN_CHUNK: Struct = &[
    (1, Bytes),
    (2, Number),
    (3, Fields(COLUMN)),
    (4, Number),
    (5, Number),
    (6, Number),
    (7, Number),
    (8, EMPTY),
    (9, Bytes),
];

const COLUMN: Struct = &[
    (1, Number),
    (2, List(&Number)),
    (3, List(&Bytes)),
    (4, Number),
    (5, Number),
    (6, Number),
    (7, Number),
    (8, List(&Fields(KEY_VALUE))),
    (9, Number),
    (10, Number),
    (11, Number),
    (12, Fields(STATISTICS)),
    (13, List(&Fields(&[(1, Number), (2, Number), (3, Number)]))),
    (14, Number),
    (15, Number),
    (16, Fields(&[(1, Number), (2, List(&Number)), (3, List(&Number))])),
    (17, Fields(&[(1, Fields(BOX)), (2, List(&Number))])),
];

const KEY_VALUE: Struct = &[(1, Bytes), (2, Bytes)];

const STATISTICS: Struct =
    &[(1, Bytes), (2, Bytes), (3, Number), (4, Number), (5, Bytes), (6, Bytes), (7, Truth), (8, Truth), (9, Number)];

const BOX: Struct =
    &[(1, Double), (2, Double), (3, Double), (4, Double), (5, Double), (6, Double), (7, Double), (8, Double)];
