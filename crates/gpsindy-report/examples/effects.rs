//! Writes the pages and pictures of the effects: `cargo run --release -p gpsindy-report --example effects -- docs/effects`.

use gpsindy_core::diagnose::Effect;
use gpsindy_report::{effect_page, effect_picture, effects_index};
use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder: PathBuf = std::env::args().nth(1).unwrap_or_else(|| "docs/effects".into()).into();
    std::fs::create_dir_all(&folder)?;
    for effect in Effect::ALL {
        let picture = effect_picture(*effect).map_err(std::io::Error::other)?;
        std::fs::write(folder.join(format!("{}.svg", effect.id())), picture.svg)?;
        std::fs::write(folder.join(format!("{}.md", effect.id())), effect_page(*effect, &picture.caption))?;
    }
    std::fs::write(folder.join("README.md"), effects_index())
}
