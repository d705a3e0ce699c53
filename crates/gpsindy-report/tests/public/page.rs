//! The page and the summary of every kind of diagnosis.

#![allow(clippy::unwrap_used, clippy::panic)]

use crate::fixtures;

use gpsindy_report::{LogFacts, Provenance, render, render_with, summary, summary_with};

#[test]
fn a_page_loads_nothing_and_runs_no_script() {
    for (name, report) in fixtures::all() {
        let page = render(&report);
        for word in ["http://", "https://", "<script", "<link rel=\"stylesheet", "@import", "url("] {
            assert!(!page.contains(word), "{name} contains {word}");
        }
    }
}

#[test]
fn a_page_says_verdict_where_which_how_far_and_next_in_this_order() {
    for (name, report) in fixtures::all() {
        let page = render(&report);
        let places: Vec<usize> =
            ["<h1", "Where is the gap?", "Which effect causes it?", "How much of it is closed?", "What to do next"]
                .iter()
                .map(|words| page.find(words).unwrap_or_else(|| panic!("{name} lacks {words}")))
                .collect();
        assert!(places.is_sorted(), "{name}: {places:?}");
    }
}

#[test]
fn a_search_that_was_cut_off_blames_its_limit_and_not_the_catalogue() {
    let mut report = fixtures::two_causes();
    report.verdict = gpsindy_core::diagnose::Verdict::PartlyExplained;
    report.unexplained.probability = 0.0;
    for cause in &mut report.causes {
        cause.stability = None;
    }
    let said = |report: &gpsindy_core::diagnose::Diagnosis| {
        summary(report, 200, false).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert!(said(&report).contains("An effect outside the catalogue may be the true cause."), "{}", said(&report));
    report.interrupted = Some(10.0);
    let cut = said(&report);
    assert!(cut.contains("The search ended before all was tried") && !cut.contains("outside the catalogue"), "{cut}");
}

#[test]
fn text_from_outside_is_escaped() {
    let mut report = fixtures::two_causes();
    report.notes.push("<img src=x onerror=alert(1)>".into());
    report.causes[0].form = "a < b && c".into();
    report.runs.train[0] = "\"><svg>.csv".into();
    let page = render(&report);
    assert!(!page.contains("<img"));
    assert!(!page.contains("\"><svg>.csv"));
    assert!(page.contains("a &lt; b &amp;&amp; c"));
    assert!(page.contains("buoy &lt;north &amp; &quot;south&quot;&gt;"));
}

#[test]
fn every_tag_that_opens_closes() {
    const VOID: [&str; 3] = ["meta", "link", "!DOCTYPE"];
    for (name, report) in fixtures::all() {
        let page = render(&report);
        let mut open: Vec<&str> = Vec::new();
        let body = page.split_once("</style>").unwrap();
        let without_style = [body.0.split_once("<style>").unwrap().0, body.1].concat();
        for tag in without_style.split('<').skip(1).map(|t| t.split_once('>').unwrap().0) {
            let word = tag.split([' ', '/']).find(|w| !w.is_empty()).unwrap();
            if tag.starts_with('/') {
                assert_eq!(open.pop().unwrap(), word, "{name}");
            } else if !VOID.contains(&word) {
                open.push(word);
            }
        }
        assert!(open.is_empty(), "{name}: {open:?}");
    }
}

#[test]
fn every_figure_has_a_title_and_a_description_of_its_own() {
    let page = render(&fixtures::explained());
    let labels: Vec<&str> =
        page.split("aria-labelledby=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    assert_eq!(labels.len(), 13, "curve, traces, rollouts, what they leave, and the signals");
    for label in labels {
        for id in label.split(' ') {
            assert_eq!(page.matches(&format!("id=\"{id}\"")).count(), 1, "{id}");
        }
    }
}

#[test]
fn a_page_without_a_cause_speaks_of_no_curve_of_an_augmented_model() {
    for (name, report) in fixtures::all() {
        let drawn = report.figures.iter().flat_map(|f| &f.rollouts).any(|figure| !figure.after.is_empty());
        assert_eq!(render(&report).contains("Solid: of the augmented one"), drawn, "{name}");
    }
}

#[test]
fn no_number_on_a_page_is_infinite_or_not_a_number() {
    for (name, report) in fixtures::all() {
        let page = render(&report);
        for word in ["NaN", "inf ", "inf<", "inf\""] {
            assert!(!page.contains(word), "{name} contains {word}");
        }
    }
}

#[test]
fn times_are_in_the_unit_of_the_logs() {
    let logs = vec![LogFacts { name: "a.csv".into(), held_out: false, samples: 21, duration: 20.0 }];
    let years = Provenance { time_unit: "years".into(), logs, ..Provenance::default() };
    let mut report = fixtures::explained();
    report.closure.horizon = Some(5.0);
    let page = render_with(&report, &years).replace('\u{a0}', " ");
    let text = summary_with(&report, &years, 100, false);
    for words in ["t (years)", "3.2 to 4.1 years", "in rollouts of 5 years", "20 years", "1 1/years"] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("t (s)"));
    assert!(text.contains("3.2 to 4.1 years") && text.contains("in rollouts of 5 years"), "{text}");
    assert!(render(&report).contains("t (s)"));
}

#[test]
fn a_negative_closure_is_shown_as_it_is() {
    let report = fixtures::negative_closure();
    assert!(render(&report).contains("worse than the nominal one"));
    assert!(summary(&report, 80, false).contains("-350 %"));
}

#[test]
fn a_gap_without_a_cause_names_the_place_and_no_remedy() {
    let text = summary(&fixtures::unexplained(), 80, false);
    assert!(text.starts_with("UNEXPLAINED"));
    assert!(text.contains("depends on s and v"));
    assert!(!text.contains("in the augmented model"));
}

#[test]
fn a_twin_of_another_effect_is_named_with_its_place_and_size() {
    let mut report = fixtures::by_joint();
    report.causes[0].effect = "asymmetric_friction".into();
    for text in [summary(&report, 200, false), render(&report)] {
        let flat = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(flat.contains("cannot distinguish it from wrong parameter elbow.damping (0.5 N m s)"), "{flat}");
    }
}

#[test]
fn a_gap_where_nothing_was_suspected_does_not_blame_the_catalogue() {
    let mut report = fixtures::unexplained();
    report.by_part = fixtures::by_joint().by_part;
    let said = |report: &gpsindy_core::diagnose::Diagnosis| {
        summary(report, 200, false).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert!(said(&report).contains("no effect of the catalogue explains it"));
    report.by_part[1].asked = false;
    let asked = said(&report);
    assert!(asked.contains("no effect in elbow explains it; nothing else was a suspect"), "{asked}");
}

#[test]
fn a_summary_fits_its_width_and_one_screen() {
    for (name, report) in fixtures::all() {
        for width in [60, 80, 120] {
            let text = summary(&report, width, false);
            for line in text.lines() {
                assert!(line.chars().count() <= width, "{name}, {width}: {line}");
            }
            // A power study is a table of its own.
            // A narrow terminal wraps more.
            let most = if report.power.is_some() {
                80
            } else if width < 80 {
                48
            } else {
                40
            };
            assert!(text.lines().count() <= most, "{name}, {width}: {} lines", text.lines().count());
        }
    }
}

#[test]
fn colour_adds_nothing_but_colour() {
    for (name, report) in fixtures::all() {
        let coloured = summary(&report, 80, true);
        let mut plain = String::new();
        for (i, part) in coloured.split('\x1b').enumerate() {
            plain.push_str(if i == 0 { part } else { part.split_once('m').unwrap().1 });
        }
        // A painted heading without words after it may end in blanks.
        let trimmed: Vec<&str> = plain.lines().map(str::trim_end).collect();
        assert_eq!(trimmed.join("\n") + "\n", summary(&report, 80, false), "{name}");
    }
}

#[test]
fn the_page_and_the_terminal_say_what_the_logs_could_reveal() {
    let report = fixtures::with_power();
    let page = gpsindy_report::render(&report);
    let text = gpsindy_report::summary(&report, 100, false);
    for words in [
        "Of 20 copies without any effect 1 showed a gap and 0 a cause.",
        "Would be named as one of a group",
        "indistinguishable from Stribeck friction; when smaller mistaken for viscous friction of v",
        "1.7 N down",
        "0.012 kg off",
        "mistaken for input delay of u or a gap without a cause",
        "out of reach: the control never reverses further",
    ] {
        assert!(page.replace('\u{a0}', " ").contains(words), "page: {words}");
        let flat = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(flat.contains(words), "summary: {words}\n{text}");
    }
    assert!(!gpsindy_report::render(&fixtures::no_gap()).contains("What could these logs reveal"));
}
