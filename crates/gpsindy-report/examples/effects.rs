//! Writes the pages of the effects: `cargo run --release -p gpsindy-report --example effects -- docs/effects`.

use gpsindy_core::diagnose::Effect;
use gpsindy_report::{effect_page, effects_index};
use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder: PathBuf = std::env::args().nth(1).unwrap_or_else(|| "docs/effects".into()).into();
    std::fs::create_dir_all(&folder)?;
    for effect in Effect::ALL {
        std::fs::write(folder.join(format!("{}.md", effect.id())), effect_page(*effect))?;
    }
    std::fs::write(folder.join("README.md"), effects_index())
}
