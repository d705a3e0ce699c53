//! Writes the pages and pictures of the effects: `cargo run --release -p gpsindy-report --example effects -- docs/effects docs/gallery`.

use gpsindy_core::diagnose::Effect;
use gpsindy_report::{GalleryCase, effect_page, effect_picture, effects_index};
use std::path::{Path, PathBuf};

fn main() -> std::io::Result<()> {
    let folder = |index: usize, usual: &str| -> PathBuf { std::env::args().nth(index).unwrap_or(usual.into()).into() };
    let cases = cases(&folder(2, "docs/gallery"))?;
    let folder = folder(1, "docs/effects");
    std::fs::create_dir_all(&folder)?;
    for effect in Effect::ALL {
        let picture = effect_picture(*effect).map_err(std::io::Error::other)?;
        std::fs::write(folder.join(format!("{}.svg", effect.id())), picture.svg)?;
        std::fs::write(folder.join(format!("{}.md", effect.id())), effect_page(*effect, &picture.caption, &cases))?;
    }
    std::fs::write(folder.join("README.md"), effects_index())
}

/// The pages of the gallery that have a result, by name.
fn cases(gallery: &Path) -> std::io::Result<Vec<GalleryCase>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(gallery)? {
        let path = entry?.path();
        if let (Some("md"), Some(name)) =
            (path.extension().and_then(|e| e.to_str()), path.file_stem().and_then(|n| n.to_str()))
        {
            found.extend(GalleryCase::of(name, &std::fs::read_to_string(&path)?));
        }
    }
    found.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(found)
}
