//! How long the steps of a simulator are.

/// How long steps are, s: all of them, or each row's.
pub(crate) enum Length<'a> {
    Of(f64),
    Each(&'a [f64]),
}

impl Length<'_> {
    /// Of a row.
    pub(crate) fn of(&self, row: usize) -> f64 {
        match self {
            Self::Of(dt) => *dt,
            Self::Each(dt) => dt[row],
        }
    }
}
