//! The catalogue: the effects, where they can act, and how each is written into a model.

mod applied;
pub(crate) mod custom;
pub(crate) mod definition;
pub(crate) mod effect;
mod effects;
pub(crate) mod enumerate;
pub(crate) mod example;
pub(crate) mod excited;
mod excursion;
mod form;
pub(crate) mod hypothesis;
pub(crate) mod invariance;
pub(crate) mod joint;
pub(crate) mod list;
pub(crate) mod place;
pub(crate) mod planting;
pub(crate) mod rival;
pub(crate) mod sense;
pub(crate) mod site;
mod writer;
