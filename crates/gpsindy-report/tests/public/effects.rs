//! The pages of the effects are those of the catalogue and of the gallery.

#![allow(clippy::unwrap_used, clippy::panic)]

use gpsindy_core::diagnose::Effect;
use gpsindy_report::{GalleryCase, effect_page, effect_picture, effects_index};
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The pages of the gallery that have a result, by name.
fn cases() -> Vec<GalleryCase> {
    let pages = std::fs::read_dir(root().join("docs/gallery")).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<PathBuf> = pages.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    pages.sort();
    let case = |path: &PathBuf| {
        GalleryCase::of(path.file_stem().unwrap().to_str().unwrap(), &std::fs::read_to_string(path).unwrap())
    };
    pages.iter().filter_map(case).collect()
}

#[test]
fn every_effect_has_a_page_that_is_current() {
    let folder = root().join("docs/effects");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_default();
    let hint = "run `cargo xtask effects`";
    let cases = cases();
    for effect in Effect::ALL {
        let picture = effect_picture(*effect).unwrap();
        let page = effect_page(*effect, &picture.caption, &cases);
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
            assert!(!experiment.is_empty() && effect_page(*effect, "", &[]).contains(&format!("({}.md)", twin.id())));
        }
    }
}

#[test]
fn a_page_promises_a_power_study_only_of_what_can_be_planted() {
    for effect in Effect::ALL {
        let promised = effect_page(*effect, "", &[]).contains("`--power` adds it");
        assert_eq!(promised, !effect.is_random(), "{}", effect.id());
    }
}

#[test]
fn a_case_of_the_gallery_is_linked_from_the_effects_that_its_result_names() {
    let page = "# Drive\n\nSee [bias](../effects/bias.md).\n\n**Explained**: [dry](../effects/coulomb_friction.md) in `w`, 94 %.\n";
    let case = GalleryCase::of("drive", page).unwrap();
    assert_eq!(case.effects, [Effect::CoulombFriction]);
    let cases = [case];
    let link = "Named in the gallery: [Drive](../gallery/drive.md).";
    assert!(effect_page(Effect::CoulombFriction, "", &cases).contains(link));
    assert!(!effect_page(Effect::Bias, "", &cases).contains("gallery/"));
    assert_eq!(GalleryCase::of("index", "# Gallery\n\nNo result.\n"), None);
}

#[test]
fn the_list_has_a_row_for_each_effect_with_its_symptom_its_command_and_its_export() {
    let list = effects_index();
    for effect in Effect::ALL {
        let row = list.lines().find(|line| line.contains(&format!("`--effects {}`", effect.id()))).unwrap();
        let cells: Vec<&str> = row.replace("\\|", "").leak().split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 6, "{row}");
        assert!(cells[1..5].iter().all(|cell| !cell.is_empty()), "{row}");
        assert_eq!(cells[2].ends_with('*'), effect.is_only_if_asked(), "{row}");
    }
}

#[test]
fn fields_of_a_mujoco_model_are_those_that_the_python_package_sets() {
    let source = std::fs::read_to_string(root().join("crates/gpsindy-py/python/gpsindy/mujoco/__init__.py")).unwrap();
    let list = effects_index();
    for line in source.lines().filter(|line| line.contains("f\"{joint}.")) {
        let (effect, field) = line.split_once("\", f\"{joint}.").unwrap();
        let (effect, field) = (effect.trim().trim_start_matches("(\""), field.split('"').next().unwrap());
        let row = list.lines().find(|row| row.contains(&format!("`--effects {effect}`")));
        assert!(row.unwrap_or_default().contains(&format!("`{field}` of the joint")), "{effect}: {field}");
    }
}
