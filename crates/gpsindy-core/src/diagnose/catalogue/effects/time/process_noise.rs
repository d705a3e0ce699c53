//! Random forcing of a row.

use crate::diagnose::catalogue::definition::{Definition, Traits, as_fitted};
use crate::diagnose::catalogue::example::{self, Drive, Example};
use crate::diagnose::catalogue::hypothesis::Start;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::planting::{Planting, Size};
use crate::diagnose::catalogue::writer::Writer;
use crate::error::{Error, Result};

pub(super) static DEFINITION: Definition = Definition {
    name: "random forcing",
    meaning: "Something pushes at random: gusts, a road, turbulence.",
    family: Family::Time,
    form: "random forcing of intensity q and correlation time tau",
    symbols: &[],
    parameters: "q: intensity, the spectral density at low frequency; tau: correlation time, s; rms: standard deviation",
    signature: "the machine strays from every rollout, differently in each repetition of the same run",
    places: &[Place::Random],
    sense: &[],
    twins: &[(Effect::PeriodicDisturbance, "the identical run repeated three times: what is random differs")],
    traits: Traits::PLAIN,
    write,
    plant,
    reported: as_fitted,
    example: Example::of(
        example::CART,
        Drive::Steps,
        10.0,
        "v",
        &[("v", "2*u - 0.8*v + 0.5*sin(1.7*t + 2) + 0.5*sin(4.1*t) + 0.5*sin(9.7*t + 1)")],
    ),
    in_mjcf: None,
    about: "No rollout can follow a random force, so none is fitted: an extended Kalman filter gives the likelihood of the logs with \
            an Ornstein-Uhlenbeck process in the row (the spectrum of Dryden's gusts). It is reported where the filter explains the logs \
            better than any effect does and no function of the states, the controls or the time improves it further. The \
            augmented model does not change: the statement is about the row. In the picture three sines represent it. A Kalman filter \
            of the machine needs `q` and `tau`.",
};

fn write(writer: &mut Writer<'_>) -> Result<Vec<Start>> {
    let state = &writer.model.states[writer.hypothesis.state].name;
    Err(Error::model(format!("random forcing of `{state}` is no term of an equation; a filter finds it")))
}

fn plant(_: &mut Planting<'_>) -> Result<Option<Size>> {
    Ok(None)
}
