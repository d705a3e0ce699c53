//! Drawn plants whose effect is withheld, through `gpsindy exam`: nulls stay quiet, effects are named, what is outside is not explained.
//!
//! Development seeds; the truth is simulated by code that shares nothing with the diagnosis (tests/suite).

use crate::common::Folder;
use gpsindy_suite::case::{Kind, draw_case};
use gpsindy_suite::emit::{Answer, answer, files};

#[derive(serde::Serialize)]
struct Answers {
    schema: &'static str,
    case: Vec<Answer>,
}

/// Draws cases of one kind, runs the exam over the whole catalogue, and returns the score card.
fn exam(kind: Kind, seeds: &[u64]) -> serde_json::Value {
    let folder = Folder::new();
    let mut case = Vec::new();
    for &seed in seeds {
        let drawn = draw_case(seed, Some(kind)).unwrap();
        let id = format!("case_{seed}");
        std::fs::create_dir_all(folder.path().join("suite").join(&id)).unwrap();
        for (name, text) in files(&drawn) {
            folder.write(&format!("suite/{id}/{name}"), &text);
        }
        case.push(answer(&drawn, &id));
    }
    let answers = Answers { schema: "gpsindy.suite/1", case };
    folder.write("suite/answers.toml", &toml::to_string(&answers).unwrap());
    folder.run("exam suite --quiet").done();
    serde_json::from_str(&folder.read("exam/scorecard.json")).unwrap()
}

#[test]
fn simulators_without_a_gap_are_left_in_peace() {
    let card = exam(Kind::Null, &[200, 201, 202, 204, 206]);
    assert_eq!(card["counts"]["null"], 5, "{card}");
    assert_eq!(card["false_alarms"]["hits"], 0, "{card}");
    assert_eq!(card["false_causes"]["hits"], 0, "{card}");
}

#[test]
fn withheld_effects_are_named() {
    let card = exam(Kind::Single, &[102, 103, 105, 106]);
    // Three of four: a test of the whole way, not of the rate, which the docs give on many more seeds.
    assert!(card["top_1"]["hits"].as_u64().unwrap() >= 3, "{card}");
    assert_eq!(card["needlessly_unexplained"]["hits"], 0, "{card}");
}

#[test]
fn what_the_catalogue_lacks_is_not_called_explained() {
    let card = exam(Kind::Outside, &[3, 17]);
    assert_eq!(card["wrongly_explained"]["hits"], 0, "{card}");
}
