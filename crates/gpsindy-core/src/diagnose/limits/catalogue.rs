//! Where an effect makes sense, and where it acts.

/// Deviations of a variable's noise by which it must go back in order to turn: differences of normal values reach seven in 10^12.
/// Argument.
pub(crate) const TURNED: f64 = 10.0;

/// Correlation of the ranks of time and of a variable from which that variable shows the time: nine tenths of their variance are in
/// common then. Argument.
pub(crate) const SHOWS_TIME: f64 = 0.95;

/// By how much more a name must move an equation than the one before, so that equals keep their order. Convention.
pub(crate) const CLEARLY: f64 = 1.05;

/// Where in their ranges the variables stand while one of them is tried: inside, at either side. Convention.
pub(crate) const INSIDE: (f64, f64) = (0.2, 0.8);

/// The same with the ends: where a force by a position is looked at. Convention.
pub(crate) const INSIDE_AND_ENDS: [f64; 5] = [0.0, 0.2, 0.5, 0.8, 1.0];

/// Share of its size by which a force must leave a straight line to be another load than the position: less is no other friction. Convention.
pub(crate) const STRAIGHT_FORCE: f64 = 0.02;

/// Deviations of the noise by which a value strays in logs of any length: normal values do so by five in 3 10^6. Argument.
pub(crate) const STRAYS: f64 = 5.0;

/// From what part of its value a parameter goes, to as much above it. Convention.
pub(crate) const FROM: f64 = 0.75;

/// Share of a variable's size that its range must have for it to move. Convention.
pub(crate) const MOVES: f64 = 0.01;

/// Share of a variable's size by which it must go either way: less is the error of a start. Convention.
pub(crate) const REVERSES: f64 = 0.05;

/// Sine of the angle below which two directions are one: what differences leave of equal ones is far less. Argument.
pub(crate) const ALONG: f64 = 1e-3;

/// Where an equation is probed: a mean, steps of a phase by variable and by point, and a time, so that the points have no pattern.
/// Convention.
pub(crate) const PROBED: (f64, f64, f64, f64) = (1.5, 1.7, 2.3, 0.3);

/// How many times the range of its fit an end of the travel that the logs never reach is beyond them. Convention.
pub(crate) const FAR_OFF: f64 = 10.0;

/// Share of a control's range, from zero or from its other end, that no limit of the drive takes away: with less the machine would not have been
/// driven. Argument.
pub(crate) const LET_THROUGH: f64 = 0.02;

/// Share of a typical speed within which dry friction turns around, at the start of a fit. Convention.
pub(crate) const CORNER: f64 = 0.02;

/// Least and greatest share of [`CORNER`] to which a fit may go: simulators have corners of a thousandth of their speeds, and what is sharper
/// differs by nothing that shows from friction that holds at rest. Argument.
pub(crate) const CORNERS: (f64, f64) = (0.03, 5.0);

/// Most ripples over the range of a position that functions without a name have, or over a turn: eight corners follow no more than three.
/// Convention.
pub(crate) const MOST_RIPPLES: usize = 24;

/// How suddenly a force may saturate with the slip: more gently than a hyperbola no tyre does, and beyond the last the corner is within a
/// thirtieth of the slip. Argument.
pub(crate) const SUDDEN: (f64, f64) = (1.0, 20.0);

/// Shape factor of Pacejka's magic formula: at 1 the force stays where it saturates, and above 2 it would turn around; tyres have 1.3 to 1.9 (Pacejka 2012,
/// section 4.3). Argument.
pub(crate) const SHAPE: (f64, f64) = (1.0, 2.0);

/// Moments of the nominal paths from which the size of an expression is taken: its mean square is then known to a tenth. Argument.
pub(crate) const MOMENTS_OF_PATHS: usize = 300;
