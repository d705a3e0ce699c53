//! What the diagnosis knows of every effect of the list: one file each, by family. The list names the files.
//!
//! `cargo fmt` sees no file that a macro names; `cargo xtask fmt` does.

use crate::diagnose::catalogue::definition::Definition;
use crate::diagnose::catalogue::list::{Effect, for_every_effect};

macro_rules! look_up {
    ($($variant:ident $id:ident $file:literal),+ $(,)?) => {
        $(#[path = $file] mod $id;)+

        impl Effect {
            pub(crate) fn definition(self) -> &'static Definition {
                match self { $(Self::$variant => &$id::DEFINITION),+ }
            }
        }
    };
}

for_every_effect!(look_up);
