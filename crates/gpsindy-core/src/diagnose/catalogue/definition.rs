//! The definition of an effect: one [`Definition`] per file of `effects/`.

use crate::diagnose::catalogue::effects::Effect;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::model::Model;

/// A group of effects of the same physical kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Family {
    /// A nominal parameter is wrong.
    Parameter,
    /// Functions of the state's own rate.
    Friction,
    /// Functions of a position.
    Stiffness,
    /// Products and other axes.
    Coupling,
    /// A static map of the control.
    InputStatic,
    /// A control that acts late.
    InputDynamic,
    /// A control that passes a play.
    Memory,
    /// Functions of time.
    Time,
    /// The sensor and not the plant.
    Sensor,
    /// An effect of the user's own.
    Custom,
}

/// Where an effect can act, and on what it depends there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// In an equation, on nothing.
    Row,
    /// In an equation, on its own state.
    Own,
    /// In an equation, on the place whose rate its state is; on the state itself where that may be a place.
    Position,
    /// In an equation, on another axis' state or on a control that the equation lacks.
    Other,
    /// In an equation, on two variables.
    Pair,
    /// In an equation, on time.
    Time,
    /// Wherever a parameter stands.
    Parameter,
    /// Wherever a control stands.
    Control,
    /// What a column reads.
    Sensor,
    /// In an equation, on its own state and another force of it: a control or the place that it depends on.
    Load,
    /// Wherever a control stands, on the state of the equation that it moves most.
    DriveAndSpeed,
    /// Wherever a control stands, on a control that no equation has: a column that was logged beside.
    Supply,
    /// Wherever a parameter stands, on a state that its terms hold.
    Rate,
    /// Wherever a parameter stands, on a control of the same equation.
    Heated,
    /// The difference of two places of the model.
    Gap,
}

impl Place {
    /// The places within an equation, in the order in which they are tried.
    pub(crate) const IN_A_ROW: [Self; 7] =
        [Self::Row, Self::Own, Self::Position, Self::Other, Self::Pair, Self::Time, Self::Load];

    /// The places that are not of one equation, in the order in which they are tried.
    pub(crate) const ELSEWHERE: [Self; 5] = [Self::DriveAndSpeed, Self::Supply, Self::Rate, Self::Heated, Self::Gap];

    /// The place in words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Row => "any dynamic equation",
            Self::Own => "a dynamic equation, as a function of its own state",
            Self::Position => "a dynamic equation, as a function of the position that belongs to it",
            Self::Other => {
                "a dynamic equation, as a function of another state or of a control that it does not contain"
            }
            Self::Pair => "a dynamic equation, as a function of two variables",
            Self::Time => "any dynamic equation, as a function of time",
            Self::Parameter => "every equation that contains a parameter",
            Self::Control => "every equation that contains a control",
            Self::Sensor => "a logged column",
            Self::Load => "a dynamic equation, as a function of its own state and of another force in it",
            Self::DriveAndSpeed => {
                "every equation that contains a control, as a function of the speed that the control drives"
            }
            Self::Supply => {
                "every equation that contains a control, as a function of a logged control that no equation uses"
            }
            Self::Rate => "every equation that contains a parameter, as a function of a state in its terms",
            Self::Heated => "every equation that contains a parameter, as a function of a control of the same equation",
            Self::Gap => "every equation that contains the difference of two positions",
        }
    }
}

/// What sets an effect apart where the search or the report treats effects alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Traits {
    /// Number of states that it adds to the model.
    pub(crate) added_states: usize,
    /// Reads a state before the log begins, so what the machine did then matters.
    pub(crate) reads_the_past: bool,
    /// What a control that is interpolated, not held, looks like.
    pub(crate) imitated_by_hold: bool,
    /// A power study plants one of each equation, drawn among the places that there are.
    pub(crate) has_many_places: bool,
    /// Has no one size that its exclusion could state: which pair of variables it takes changes the unit.
    pub(crate) has_no_single_size: bool,
    /// Its size is a limit: the smaller, the more it does.
    pub(crate) is_a_limit: bool,
    /// Is a suspect only where it is asked for by its id: it costs more false names or time than it is worth unasked.
    pub(crate) only_if_asked: bool,
}

impl Traits {
    /// Nothing of note.
    pub(crate) const PLAIN: Self = Self {
        added_states: 0,
        reads_the_past: false,
        imitated_by_hold: false,
        has_many_places: false,
        has_no_single_size: false,
        is_a_limit: false,
        only_if_asked: false,
    };
}

/// An effect: what it is called, where it acts, how it is written into a model and how it is planted.
pub(crate) struct Definition {
    /// Its name in everyday words.
    pub(crate) name: &'static str,
    /// What it does, for a reader who meets it first in a report.
    pub(crate) meaning: &'static str,
    pub(crate) family: Family,
    /// What it adds to the right side of the state's equation, or does to the control or the column.
    pub(crate) form: &'static str,
    /// The symbols of the form that stand for the variables it depends on, in their order.
    pub(crate) symbols: &'static [&'static str],
    /// Its parameters in words.
    pub(crate) parameters: &'static str,
    /// What it looks like in a log.
    pub(crate) signature: &'static str,
    pub(crate) places: &'static [Place],
    /// What must hold at a place for the effect to make sense there.
    pub(crate) sense: &'static [Sense],
    /// Effects that logs may not tell from it, and the experiment that parts them. It is enough that one of the two names
    /// the other.
    pub(crate) twins: &'static [(Effect, &'static str)],
    pub(crate) traits: Traits,
    /// Writes it into a model for the search, with start values and bounds of its parameters.
    pub(crate) write: fn(&mut Writer<'_>) -> Result<Vec<Start>>,
    /// Plants it in a model for a power study, as the machine might have it; `None` where there is nothing to plant.
    pub(crate) plant: fn(&mut Planting<'_>) -> Result<Option<Size>>,
    /// The fitted model as a reader should have it: `(model, state)`.
    pub(crate) told: fn(&mut Model, usize),
    /// For its page: how it is fitted, where it fails, where the form comes from. May be empty.
    pub(crate) about: &'static str,
}

/// For [`Definition::told`]: the model as it was fitted.
pub(crate) fn as_fitted(_: &mut Model, _: usize) {}

/// For [`Definition::twins`]: experiments that part more than one pair.
pub(crate) mod experiment {
    pub(crate) const SLOW_REVERSALS: &str = "slow reversals at three or more speeds, or a coast-down";
    pub(crate) const KNOWN_LOAD: &str = "add a known mass or load, or check one static reading against a ruler";
    pub(crate) const TURN_THE_RIG: &str = "turn the rig around, or hold still at two positions";
    pub(crate) const TRIANGLES: &str = "triangles of rising amplitude about two offsets";
    pub(crate) const AMPLITUDES: &str = "one frequency at several amplitudes";
    pub(crate) const THE_SAME_AGAIN: &str = "the identical run repeated three times";
    pub(crate) const LARGER: &str = "a larger amplitude, or a second mean position";
    /// Where no pair has one of its own.
    pub(crate) const ANOTHER_RUN: &str = "a run with another amplitude, offset and speed than the given logs";
}
