//! Random plants with known effects, to test the diagnosis.
//!
//! The generator shares no code with what it examines: its own integrator, true sticking, true play, exact delays and
//! switch times, and the physics of every plant written a second time, apart from the text of the nominal model.

pub mod case;
pub mod choose;
pub mod effect;
pub mod emit;
pub mod excite;
pub mod fit;
pub mod gap;
pub mod integrate;
pub mod plant;
pub mod plants;
pub mod random;
mod scene;
pub mod second;
pub mod sensor;
pub mod simulate;
pub mod survey;
pub mod twins;
