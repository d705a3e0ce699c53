//! The noise of the sensors.

/// Highest order of a column's noise model: what a filter of order four in a sensor and its thinning leave. BIC takes less
/// where less will do. Argument.
pub(crate) const MAX_ORDER: usize = 6;

/// Variance of the innovations (noise units) up to which they can be noise: differences of samples see those of a random
/// walk, the slowest noise there is, as 3.6. Argument.
pub(crate) const ROUGH: f64 = 4.0;

/// Means of a window up to which a column is not predicted from another: twice as many as there are terms. Argument.
pub(crate) const MEANS: usize = 4 * (MAX_ORDER + 1);

/// Residual variance (noise units) up to which the winner's residual counts as noise, with its colour: an effect of half
/// the noise's variance would have been material. Argument.
pub(crate) const NOISE: f64 = 1.5;

/// How many values of a residual may repeat each other where its colour is a sensor's, whatever its variance: half of them are then news. An
/// autoregression with a coefficient of 0.58 has it. What a model lacks is as slow as the machine, of which a log has many samples. Argument.
pub(crate) const REPEATED: f64 = 2.0;

/// Values over which repetition is counted for that: a sensor's memory that is longer is no short one. Argument.
pub(crate) const SHORT: usize = 100;

/// Frequencies at which the residual's spectrum is looked at, and lines of it that a periodic effect starts from: the
/// first harmonics of one disturbance. Convention.
pub(crate) const FREQUENCIES: usize = 400;
pub(crate) const LINES: usize = 5;
/// Of what lies between two of these frequencies, as many are tried as may lie beside the top: it, and one on each side. Argument.
pub(crate) const OF_LINE: usize = 3;

/// Least `(1 - sum a_k)^2` of a noise model, by which its spectrum at zero frequency is divided: noise that remembers for 32 samples.
/// A residual that remembers longer can hardly be distinguished from a drift, whose spectrum there has no bound. Argument.
pub(crate) const SPECTRUM_FLOOR: f64 = 1e-3;

/// Share of the highest frequency that a log can carry up to which its spectrum is looked at: beyond that a line is as far below
/// as above. Convention.
pub(crate) const CARRIED: f64 = 0.8;

/// Samples of a period that a line of the spectrum is summed over in a long window: an error of a thirtieth. Argument.
pub(crate) const OF_PERIOD: f64 = 8.0;

/// Share of their variance that normal values keep without the largest fiftieth of their squares. Argument.
pub(crate) const TRIMMED: f64 = 0.857;

/// Deviations of a normal variable in the median of its size. Argument.
pub(crate) const OF_MEDIAN: f64 = 1.4826;

/// By how much of itself noise alone bends a line through three samples: `sqrt(1 + 2/4)`. Argument.
pub(crate) const BENT: f64 = 1.2;

/// Mean squared residual (noise units) of the nominal fit in a column that says its noise was overstated. Above a half, starts and chance
/// leave as little. Below a hundredth of the standard deviation the column has no noise to speak of, and arithmetic is what is left.
/// Convention.
pub(crate) const OVERSTATED: std::ops::Range<f64> = 1e-4..0.5;

/// How often the noise is lowered to what the nominal fit leaves: a fit that takes a column's noise for six times what it is leaves more than
/// one that knows. Convention.
pub(crate) const LOWERED: usize = 3;
