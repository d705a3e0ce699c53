//! Pages, schemas and the score card, in one program: each of its own would compile and link the library's generic code once more.

mod effects;
mod fixtures;
mod page;
mod schema;
mod scorecard;
