//! Numbers of the machine's kinds, as messages hold them.

/// What a value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(not(feature = "mcap"), expect(dead_code, reason = "ULog has numbers only"))]
pub(crate) enum Kind {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Text,
    WideText,
    /// Index into the schema's messages.
    Message(usize),
}

impl Kind {
    /// Bytes of a number; `None` for text and messages.
    pub(crate) fn size(self) -> Option<usize> {
        Some(match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Text | Self::WideText | Self::Message(_) => return None,
        })
    }
}

/// A number of `kind` in its bytes.
pub(crate) fn number(kind: Kind, bytes: &[u8], big: bool) -> f64 {
    // Most numbers of robots' logs.
    if let (Kind::F64, false, Ok(eight)) = (kind, big, bytes.try_into()) {
        return f64::from_le_bytes(eight);
    }
    let mut eight = [0_u8; 8];
    for (i, slot) in eight.iter_mut().take(bytes.len()).enumerate() {
        *slot = if big { bytes[bytes.len() - 1 - i] } else { bytes[i] };
    }
    let bits = u64::from_le_bytes(eight);
    match kind {
        Kind::Bool => f64::from(u8::from(bits != 0)),
        Kind::I8 => f64::from(bits as u8 as i8),
        Kind::U8 | Kind::U16 | Kind::U32 => f64::from(bits as u32),
        Kind::I16 => f64::from(bits as u16 as i16),
        Kind::I32 => f64::from(bits as u32 as i32),
        Kind::I64 => bits as i64 as f64,
        Kind::U64 => bits as f64,
        Kind::F32 => f64::from(f32::from_bits(bits as u32)),
        Kind::F64 => f64::from_bits(bits),
        Kind::Text | Kind::WideText | Kind::Message(_) => f64::NAN,
    }
}
