//! The families of plants: each draws its parameters and states the same physics twice, as text and as code.

mod electric;
mod mechanic;
mod process;
mod vehicle;

use crate::plant::Plant;
use crate::random::Draw;

/// A family: draws a plant.
pub type Family = fn(&mut Draw) -> Plant;

/// All families.
pub fn families() -> Vec<Family> {
    [mechanic::FAMILIES, electric::FAMILIES, process::FAMILIES, vehicle::FAMILIES].concat()
}
