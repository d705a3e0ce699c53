//! What a user of the crate sees, in one program: each of its own would compile and link the library's generic code once more.

mod author;
mod design;
mod export;
mod export_hostile;
mod simulate;
mod smooth_torture;
mod sticking;
mod threads;
mod topics;
