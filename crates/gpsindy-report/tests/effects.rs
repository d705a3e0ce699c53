//! The pages of the effects are those of the catalogue.

#![allow(clippy::unwrap_used, clippy::panic)]

use gpsindy_core::diagnose::Effect;
use gpsindy_report::{effect_page, effect_picture, effects_index};
use std::path::Path;

#[test]
fn every_effect_has_a_page_that_is_current() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/effects");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_default();
    let hint = "run `cargo xtask effects`";
    for effect in Effect::ALL {
        let picture = effect_picture(*effect).unwrap();
        let page = effect_page(*effect, &picture.caption);
        assert!(read(&format!("{}.md", effect.id())) == page, "{} is out of date; {hint}", effect.id());
        // Sine and exponential may differ in the last bit between platforms, which can move a rounded digit.
        let kept = read(&format!("{}.svg", effect.id()));
        assert!(kept.len().abs_diff(picture.svg.len()) < 64, "the picture of {} is out of date; {hint}", effect.id());
    }
    assert!(read("README.md") == effects_index(), "the list is out of date; {hint}");
    let pages = std::fs::read_dir(folder).unwrap().count();
    assert_eq!(pages, 2 * Effect::ALL.len() + 1, "a page without an effect; {hint}");
}

#[test]
fn a_page_links_only_to_pages_that_are_there() {
    for effect in Effect::ALL {
        for (twin, experiment) in effect.twins() {
            assert!(!experiment.is_empty() && effect_page(*effect, "").contains(&format!("({}.md)", twin.id())));
        }
    }
}
