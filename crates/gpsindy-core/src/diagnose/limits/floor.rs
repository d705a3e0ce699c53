//! The floor of every column.

/// Share of a control's spread by which repeated commands may differ: rounding, not another command.
/// Ten bits of a converter. Argument.
pub(crate) const SAME_COMMAND: f64 = 1e-3;

/// Share of the noise below which runs do not differ by chance: they are copies. Eight samples of noise scatter
/// below it once in a thousand times. Argument.
pub(crate) const COPIES: f64 = 0.3;

/// First samples whose mean shows the start, and how many of its standard deviations two starts may differ.
/// Five samples are a moment; of normal means none in 15,000 is four deviations away. Argument.
pub(crate) const FIRST_SAMPLES: usize = 5;
pub(crate) const SAME_START: f64 = 4.0;

/// Share of a step by which the times of two runs may differ: jitter, and not another clock. Convention.
pub(crate) const SAME_TIME: f64 = 0.05;

/// Starts that are drawn where a simulator steps: their mean square is known to a third. Argument.
pub(crate) const STARTS_DRAWN: usize = 16;
