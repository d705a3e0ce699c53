//! Every threshold of the diagnosis, of an identification and of a fleet is in its `limits`, once, and says where its value comes from;
//! none is anywhere else.
#![allow(clippy::unwrap_used)]

#[path = "layers/sources.rs"]
mod sources;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a docstring of a threshold ends with.
const LABELS: [&str; 3] = ["Argument.", "Convention.", "Data: "];

/// What a docstring of a constant says that is no threshold: exact, or a guard against rounding.
const EXACT: [&str; 2] = ["Exact.", "Rounding."];

/// Numbers that say nothing beyond themselves: none, half, one, and twice.
const PLAIN: [f64; 4] = [0.0, 0.5, 1.0, 2.0];

/// Half of the digits of a double: what is smaller guards against rounding.
const ROUNDING: f64 = 1.5e-8;

/// Where numbers are the matter itself: what defines an effect (its starts, ranges, planted sizes and where it is probed), and
/// tests.
const DEFINITIONS: [&str; 12] = [
    "catalogue/effects/",
    "catalogue/custom/starts.rs",
    "catalogue/example.rs",
    "catalogue/joint.rs",
    "catalogue/planting.rs",
    "catalogue/rival.rs",
    "catalogue/writer.rs",
    "contract.rs",
    "drawn.rs",
    "fixture.rs",
    "limits.rs",
    "limits/",
];

/// The methods whose thresholds are looked through.
const METHODS: [&str; 3] = ["diagnose", "identify", "fleet"];

/// Every source of a method, from its folder: `steps/verify.rs`.
fn all(method: &str) -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../gpsindy-core/src").join(method);
    let mut files = Vec::new();
    sources::collect(&root, &mut files);
    let named = |path: &PathBuf| {
        let name = path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        (name, std::fs::read_to_string(path).unwrap())
    };
    files.iter().map(named).collect()
}

/// The constants of a source that are numbers, each with its docstring or that of the group it belongs to.
fn constants(source: &str) -> Vec<(String, String)> {
    let (mut found, mut doc, mut open) = (Vec::new(), String::new(), false);
    for line in sources::without_tests(source).lines().map(str::trim) {
        let constant = line.strip_prefix("pub(crate) ").or_else(|| line.strip_prefix("pub(super) ")).unwrap_or(line);
        let constant = constant.strip_prefix("pub ").unwrap_or(constant).strip_prefix("const ");
        if let Some(text) = line.strip_prefix("///") {
            if !open {
                doc.clear();
            }
            open = true;
            doc.push_str(text);
        } else if let Some((name, kind)) = constant.and_then(|c| c.split_once(':')) {
            open = false;
            if ["f64", "usize", "u64", "i32"].iter().any(|number| kind.contains(number)) {
                found.push((name.to_string(), doc.trim().to_string()));
            }
        } else {
            open = false;
            doc.clear();
        }
    }
    found
}

/// Thresholds without a label.
fn unlabelled(files: &[(String, String)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (file, source) in files {
        for (name, doc) in constants(source) {
            if !LABELS.iter().any(|label| doc.rsplit_once(label).is_some_and(|(_, after)| !after.contains(". "))) {
                wrong.push(format!("{file}: {name} does not say whether it is an Argument, a Convention or Data"));
            }
        }
    }
    wrong
}

/// Names that stand for two thresholds.
fn ambiguous(files: &[(String, String)]) -> Vec<String> {
    let (mut wrong, mut known) = (Vec::new(), BTreeMap::<String, String>::new());
    for (file, source) in files {
        for (name, _) in constants(source) {
            if let Some(other) = known.insert(name.clone(), file.clone()) {
                wrong.push(format!("{file}: {name} is also in {other}"));
            }
        }
    }
    wrong
}

/// Numbers with a point or an exponent in a line of code.
fn floats(line: &str) -> Vec<f64> {
    let code = line.split("//").next().unwrap_or_default();
    // Text is no number.
    let code: String = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
    let (mut words, mut inside) = (Vec::<String>::new(), false);
    for c in code.chars() {
        let word = words.last().filter(|_| inside);
        // The sign of an exponent.
        let is_sign = matches!(c, '-' | '+')
            && word.is_some_and(|w| w.starts_with(|c: char| c.is_ascii_digit()) && w.ends_with('e'));
        let is_part = is_sign || c.is_ascii_alphanumeric() || c == '_' || c == '.';
        match words.last_mut().filter(|_| inside) {
            Some(word) if is_part => word.push(c),
            _ if is_part => words.push(c.to_string()),
            _ => {}
        }
        inside = is_part;
    }
    let number = |word: &String| {
        let word = word.replace('_', "").replace("f64", "");
        let is_float = word.starts_with(|c: char| c.is_ascii_digit()) && (word.contains('.') || word.contains('e'));
        // `1.0.max(x)` and ranges such as `0..n` leave a rest behind the number.
        let end =
            word.find("..").or_else(|| word.find(|c: char| c.is_ascii_alphabetic() && c != 'e')).unwrap_or(word.len());
        is_float.then(|| word[..end].trim_end_matches('.').to_string())
    };
    let with_point = |text: String| (text.contains('.') || text.contains('e')).then(|| text.parse().ok())?;
    words.iter().filter_map(number).filter_map(with_point).collect()
}

/// Numbers of a source that stand for something and have no name in `limits`.
fn bare(source: &str) -> Vec<(usize, f64)> {
    let exact = constants(source);
    let exact = |line: &str| {
        let name = line.split_once("const ").and_then(|(_, rest)| rest.split_once(':'));
        name.is_some_and(|(name, _)| {
            exact.iter().any(|(n, doc)| n == name && EXACT.iter().any(|label| doc.ends_with(label)))
        })
    };
    let is_plain = |v: &f64| PLAIN.contains(v) || *v < ROUNDING;
    let (mut found, mut inside) = (Vec::new(), false);
    for (number, line) in sources::without_tests(source).lines().enumerate() {
        inside = inside || exact(line);
        if !inside {
            found.extend(floats(line).into_iter().filter(|v| !is_plain(v)).map(|v| (number + 1, v)));
        }
        inside = inside && !line.trim_end().ends_with(';');
    }
    found
}

#[test]
fn every_threshold_has_one_name_and_says_where_it_comes_from() {
    let mut wrong = Vec::new();
    for (method, least) in METHODS.iter().zip([100, 10, 10]) {
        let files: Vec<(String, String)> =
            all(method).into_iter().filter(|(file, _)| file.starts_with("limits")).collect();
        assert!(files.iter().map(|(_, source)| constants(source).len()).sum::<usize>() > least, "{method}");
        wrong.extend([unlabelled(&files), ambiguous(&files)].concat().iter().map(|what| format!("{method}/{what}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_number_decides_anything_outside_of_the_limits() {
    let outside = |(file, _): &(String, String)| {
        let is_test = file.split('/').any(|part| part == "tests.rs" || part == "tests");
        !is_test && !DEFINITIONS.iter().any(|place| file.starts_with(place))
    };
    let mut wrong = Vec::new();
    for method in METHODS {
        for (file, source) in all(method).iter().filter(|file| outside(file)) {
            let bare = bare(source).into_iter();
            wrong.extend(bare.map(|(line, value)| format!("{method}/{file}:{line}: {value} has no name in limits")));
            for (name, doc) in constants(source) {
                if !EXACT.iter().any(|label| doc.ends_with(label)) && !name.starts_with("ALL") {
                    wrong.push(format!("{method}/{file}: {name} is neither in limits nor Exact or Rounding"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_bare_number_and_a_threshold_without_a_label_would_be_seen() {
    let values = |line: &str| floats(line);
    assert_eq!(values("if x.0 > 0.05 * 1e-3_f64.max(y) { 1_000.5 } // 0.7"), [0.05, 1e-3, 1000.5]);
    assert_eq!(values("let a = b[0] + 3; for i in 0..4 { say(\"0.3\") } a.1e2"), [] as [f64; 0]);
    assert_eq!(bare("let a = 0.5 * b;\nif c < 1e-12 { 1.96 }\n#[cfg(test)]\nmod tests { 0.3 }"), [(2, 1.96)]);
    assert!(bare("/// Euler's number. Exact.\nconst EULER: f64 = 0.577;").is_empty());
    assert!(bare("/// The nodes. Exact.\nconst NODES: [f64; 2] =\n    [0.3, 0.7];\nlet a = 1.0;").is_empty());
    assert_eq!(bare("/// Wide enough.\nconst WIDE: f64 = 0.1;"), [(2, 0.1)]);
    let file = |text: &str| vec![("limits/a.rs".to_string(), text.to_string())];
    assert!(
        unlabelled(&file("/// What counts. Argument.\npub(crate) const A: f64 = 3.0;\npub(crate) const B: usize = 4;"))
            .is_empty()
    );
    assert!(unlabelled(&file("/// What counts. Data: seeds 1 to 9.\npub(crate) const A: f64 = 3.0;")).is_empty());
    assert_eq!(unlabelled(&file("/// What counts.\npub(crate) const A: f64 = 3.0;")).len(), 1);
    let twice =
        "/// One. Argument.\npub(crate) const A: f64 = 3.0;\n\n/// Two. Argument.\npub(crate) const A: f64 = 4.0;";
    assert_eq!(ambiguous(&file(twice)).len(), 1);
}
