//! The definition of an effect: one [`Definition`] per file of `effects/`.

use crate::diagnose::catalogue::example::Example;
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::writer::Writer;
use crate::error::Result;
use crate::model::Model;

/// What sets an effect apart where the search or the report treats effects alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Traits {
    /// Effects that it becomes where one of its parameters does nothing: their parameters are the first and the last
    /// of its own, and they stand in its place wherever they fit as well. A wrong parameter is one that always is as warm.
    pub(crate) contains: &'static [Effect],
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
    /// Is itself what makes a place unlike others, as a stop at the end of a rail or the magnets along it: where no rate depends on the
    /// place it is a suspect once nothing else explains the logs.
    pub(crate) marks_a_place: bool,
    /// Effects that imitate it; where one of them leads in the same equation, this one is a suspect there, asked for or not.
    pub(crate) behind: &'static [Effect],
}

impl Traits {
    /// Nothing of note.
    pub(crate) const PLAIN: Self = Self {
        contains: &[],
        added_states: 0,
        reads_the_past: false,
        imitated_by_hold: false,
        has_many_places: false,
        has_no_single_size: false,
        is_a_limit: false,
        only_if_asked: false,
        marks_a_place: false,
        behind: &[],
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
    /// Effects that logs may not distinguish from it, and the experiment that distinguishes them. It is enough that one of the two names
    /// the other.
    pub(crate) twins: &'static [(Effect, &'static str)],
    pub(crate) traits: Traits,
    /// Writes it into a model for the search, with start values and bounds of its parameters.
    pub(crate) write: fn(&mut Writer<'_>) -> Result<Vec<Start>>,
    /// Plants it in a model for a power study, as the machine might have it; `None` where there is nothing to plant.
    pub(crate) plant: fn(&mut Planting<'_>) -> Result<Option<Size>>,
    /// The fitted model as a reader should have it: `(model, state)`.
    pub(crate) reported: fn(&mut Model, usize),
    /// What it looks like, on a machine of one or two axes.
    pub(crate) example: Example,
    /// The field of an MJCF file that carries it, if there is one.
    pub(crate) in_mjcf: Option<&'static str>,
    /// For its page: how it is fitted, where it fails, where the form comes from. May be empty.
    pub(crate) about: &'static str,
}

/// For [`Definition::reported`]: the model as it was fitted.
pub(crate) fn as_fitted(_: &mut Model, _: usize) {}

/// For [`Definition::twins`]: experiments that distinguish more than one pair.
pub(crate) mod experiment {
    pub(crate) const SLOW_REVERSALS: &str = "slow reversals at three or more speeds, or a coast-down";
    pub(crate) const KNOWN_LOAD: &str = "add a known mass or load, or check one static reading against a ruler";
    pub(crate) const TURN_THE_RIG: &str = "turn the rig around, or hold still at two positions";
    pub(crate) const TRIANGLES: &str = "triangles of rising amplitude about two offsets";
    pub(crate) const AMPLITUDES: &str = "one frequency at several amplitudes";
    pub(crate) const THE_SAME_AGAIN: &str = "the identical run repeated three times";
    pub(crate) const LARGER: &str = "a larger amplitude, or a second mean position";
    /// Of two numbers of a simulator: a servo's damping and its joint's are one as long as the servo is on.
    pub(crate) const ONE_CHANGED: &str = "a run with one of the two changed on purpose (another gain, the servo off and the joint moved by hand, another load), or with another amplitude, offset and speed";
    /// Where no pair has one of its own.
    pub(crate) const ANOTHER_RUN: &str = "a run with another amplitude, offset and speed than the given logs";
}
