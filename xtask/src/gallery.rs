//! The gallery: its pages are run, and keep what came out: printed text, pictures, reports, and the verdict in a line.

use crate::files::{copy, files, read, write};
use crate::pages::all_of;
use crate::shell::root;
use crate::snippets::{Ran, Tools, blocks, run_page, with_outputs};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Runs every page of `folder`, or the one called `only`, and leaves its results there; with `html` also the whole reports, which only a
/// site can show.
pub(crate) fn run(folder: &Path, only: Option<&str>, tools: &Tools, html: bool) -> Result<(), String> {
    let index = folder.join("README.md");
    let pages: Vec<PathBuf> = files(folder, "md")?.into_iter().filter(|page| *page != index).collect();
    let name_of = |page: &Path| page.file_stem().and_then(|name| name.to_str()).unwrap_or_default().to_string();
    let pages = pages.iter().map(|page| (page, name_of(page))).filter(|(_, name)| only.is_none_or(|only| only == name));
    all_of(pages.map(|(page, name)| {
        let ran = run_page(page, &format!("gallery/{name}"), None, tools)?;
        keep(page, &name, &ran, html)
    }))?;
    write(
        &index,
        &with_results(&read(&index)?, |name| {
            read(&folder.join(format!("{name}.md"))).ok().and_then(|page| result_of(&page).map(str::to_string))
        }),
    )
}

/// What the run of a page leaves as data and as a page: a diagnosis, or the comparison of a fleet.
const LEFT: [(&str, &str); 2] =
    [("diagnosis/report.json", "diagnosis/report.html"), ("result/fleet.json", "result/fleet.html")];

/// Writes the page anew, and its files next to it.
fn keep(page: &Path, name: &str, ran: &Ran, html: bool) -> Result<(), String> {
    let folder = page.parent().unwrap_or(page);
    let mut text = with_outputs(&read(page)?, &ran.printed);
    let left = LEFT.map(|(data, page)| (ran.folder.join(data), ran.folder.join(page)));
    let committed = result_of(&text).map(str::to_string);
    if let Some((at, (data, whole))) = left.iter().enumerate().find(|(_, (data, _))| data.exists()) {
        copy(data, &folder.join(format!("reports/{name}.json")))?;
        let (report, drawn, of_fleet) = (read(data)?, read(whole)?, at > 0);
        // The page of a fleet shows its units first; that of a diagnosis the column that the simulator misses most.
        let missed = if of_fleet { None } else { most_missed(&report)? };
        let of_missed = |title: &str| missed.as_ref().is_some_and(|c| title.contains(&format!(">{c} in held-out run")));
        let rollout = |title: &str| of_fleet || title.contains("in held-out run") && !title.contains("Residual");
        let gap = |title: &str| title.contains("Residual of the equation") && title.contains("against");
        let shown = picture(&drawn, of_missed).or_else(|| picture(&drawn, rollout));
        let pictures = [(String::new(), shown), ("_gap".into(), picture(&drawn, gap))];
        for (ending, picture) in pictures.into_iter().filter_map(|(ending, picture)| Some((ending, picture?))) {
            write(&folder.join(format!("pictures/{name}{ending}.svg")), &picture)?;
        }
        if !of_fleet {
            text = with_result(&text, &result(&report)?);
        }
        // A site that is built has the results of the tree that it is built from.
        if html && result_of(&text) != committed.as_deref() {
            let (old, new) = (committed.unwrap_or_default(), result_of(&text).unwrap_or_default());
            return Err(format!(
                "docs/gallery/{name}.md states\n{old}\nand the run gives\n{new}\nrun `cargo xtask gallery {name}`"
            ));
        }
        if html {
            copy(whole, &folder.join(format!("reports/{name}.html")))?;
            // The comparison of a fleet leads to the report of every machine.
            let tasks = ran.folder.join("result/tasks");
            if tasks.is_dir() {
                copy(&tasks, &folder.join("reports/tasks"))?;
            }
            text = text.replace(&format!("(reports/{name}.json)"), &format!("(reports/{name}.html)"));
        }
    }
    for picture in std::fs::read_dir(&ran.folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
        if let (Some("svg" | "png"), Some(name)) = (picture.extension().and_then(|e| e.to_str()), picture.file_name()) {
            copy(&picture, &folder.join(name))?;
        }
    }
    let program: Vec<&str> = blocks(&text).filter(|(l, _)| *l == "python").map(|(_, block)| block).collect();
    write(&folder.join(format!("{name}.py")), &program.join("\n"))?;
    write(page, &text)
}

/// The column whose held-out rollouts of the simulator are furthest from the log, in units of what noise alone causes.
fn most_missed(report: &str) -> Result<Option<String>, String> {
    let report: Value = serde_json::from_str(report).map_err(|e| format!("report.json: {e}"))?;
    let columns = report["closure"]["by_state"].as_array().into_iter().flatten();
    let ratio = |column: &Value| Some(column["before"].as_f64()? / column["floor"].as_f64()?);
    let known = columns.filter_map(|column| Some((column["state"].as_str()?.to_string(), ratio(column)?)));
    Ok(known.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(name, _)| name))
}

/// The verdict of a report in a line of Markdown: bold, with links to the effects.
fn result(report: &str) -> Result<String, String> {
    let report: Value = serde_json::from_str(report).map_err(|e| format!("report.json: {e}"))?;
    let verdict = report["verdict"].as_str().unwrap_or_default().replace('_', " ");
    let causes = report["causes"].as_array().into_iter().flatten().filter(|cause| cause["included"] == true);
    let causes: Vec<String> = causes.map(cause).collect();
    let mut line = format!("**{}{}**", verdict[..1].to_uppercase(), &verdict[1..]);
    if !causes.is_empty() {
        line += &format!(": {}", causes.join(" and "));
        if let Some(closed) = report["closure"]["closed"].as_f64().filter(|_| !causes[0].contains("process_noise")) {
            line += &format!("; closes {} of the held-out gap", percent(closed));
        }
    } else if report["gap"]["detected"] == true {
        // What is left depends on; where that is not known, where the gap lies.
        let left = report["unexplained"]["depends_on"].as_array().into_iter().flatten();
        let regions = report["gap"]["by_region"].as_array().into_iter().flatten().map(|region| &region["variable"]);
        if let Some(name) = left.chain(regions).find_map(Value::as_str) {
            line += &format!(": the gap depends on `{name}`");
        }
    } else if let Some(p) = report["gap"]["p_value"].as_f64() {
        line += &format!(": p = {p:.2} under noise alone");
    }
    Ok(line + ".")
}

fn cause(cause: &Value) -> String {
    let id = cause["effect"].as_str().unwrap_or_default();
    let place = cause["place"].as_str().or(cause["state"].as_str()).unwrap_or_default();
    let place = if id == "parameter_error" { cause["variables"][0].as_str().unwrap_or(place) } else { place };
    let control = id.starts_with("input_").then(|| cause["variables"][0].as_str()).flatten();
    let (place, name) = (control.unwrap_or(place), name_of(id));
    format!("[{name}](../effects/{id}.md) at `{place}`, {}", percent(cause["probability"].as_f64().unwrap_or_default()))
}

/// The name of an effect, as the heading of its page has it.
fn name_of(id: &str) -> String {
    let page = read(&root().join(format!("docs/effects/{id}.md"))).unwrap_or_default();
    let heading = page.strip_prefix("# ").and_then(|rest| rest.split(": `").next());
    heading.map_or_else(|| id.replace('_', " "), str::to_string)
}

fn percent(share: f64) -> String {
    match share {
        s if s > 0.995 => "more than 99 %".into(),
        s if s < 0.005 => "less than 1 %".into(),
        s => format!("{:.0} %", 100.0 * s),
    }
}

/// The line of a page that states its result.
fn result_of(page: &str) -> Option<&str> {
    page.lines().find(|line| line.starts_with("**"))
}

/// The page with its result below its heading, in place of an earlier one.
fn with_result(page: &str, result: &str) -> String {
    if let Some(old) = result_of(page) {
        return page.replacen(old, result, 1);
    }
    let (heading, rest) = page.split_once("\n\n").unwrap_or((page, ""));
    format!("{heading}\n\n{result}\n\n{rest}")
}

/// The index with the result of each page in the last cell of its row.
fn with_results(index: &str, result: impl Fn(&str) -> Option<String>) -> String {
    let row = |line: &str| {
        let name = line.split_once("](")?.1.split_once(".md)")?.0;
        let (cells, _) = line.strip_suffix('|')?.rsplit_once('|')?;
        (!name.contains('/')).then(|| result(name)).flatten().map(|result| format!("{cells}| {result} |"))
    };
    index.lines().map(|line| row(line).unwrap_or_else(|| line.into()) + "\n").collect()
}

/// The first chart of a report whose title is `wanted`, as a file of its own.
fn picture(page: &str, wanted: impl Fn(&str) -> bool) -> Option<String> {
    // A page may have styles of its own beside the common one.
    let styles: Vec<&str> = page.split("<style>").skip(1).filter_map(|rest| rest.split("</style>").next()).collect();
    let style = styles.join("\n");
    let mut charts = page.split("<svg viewBox=").skip(1).filter(|chart| chart.contains("role=\"img\""));
    let title =
        |chart: &str| chart.split_once("<title").and_then(|(_, rest)| rest.split("</title>").next()).map(&wanted);
    let chart = charts.find(|chart| title(chart) == Some(true))?;
    // A chart holds one more drawing.
    let end = chart.match_indices("</svg>").nth(1)?.0;
    let first = |start: &str| style.split(start).nth(1).and_then(|rest| rest.split('}').next());
    let colours = first(":root {")?;
    let rules: Vec<&str> = style.lines().filter(|line| line.starts_with("svg ")).collect();
    let style = format!(":root {{{}}}\n{}", colours.replace("color-scheme: light dark;", ""), rules.join("\n"));
    let (open, rest) = chart[..end].split_once('>')?;
    Some(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox={open}><style>{style}</style><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>{rest}</svg>\n"
    ))
}

/// The gallery of the repository, or one page of it, run anew.
pub(crate) fn write_all(only: Option<&str>, tools: &Tools) -> Result<(), String> {
    run(&root().join("docs/gallery"), only, tools, false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_shows_the_column_that_the_simulator_misses_most() {
        let report = r#"{"closure": {"by_state": [{"state": "q", "before": 2.0, "floor": 1.0},
            {"state": "w", "before": 0.5, "floor": 0.1}, {"state": "x", "before": null, "floor": 1.0}]}}"#;
        assert_eq!(most_missed(report), Ok(Some("w".into())));
        assert_eq!(most_missed("{}"), Ok(None));
    }

    #[test]
    fn a_result_names_verdict_cause_probability_and_what_closes() {
        let report = r#"{"verdict": "explained", "gap": {"detected": true}, "closure": {"closed": 0.97},
            "causes": [{"effect": "coulomb_friction", "state": "w", "included": true, "probability": 0.94},
                       {"effect": "bias", "state": "w", "included": false, "probability": 0.02}]}"#;
        let expected = "**Explained**: [Coulomb friction](../effects/coulomb_friction.md) at `w`, 94 %; closes 97 % of the held-out gap.";
        assert_eq!(result(report).unwrap(), expected);
        let nothing =
            r#"{"verdict": "no_gap", "gap": {"detected": false, "p_value": 0.4}, "closure": {}, "causes": []}"#;
        assert_eq!(result(nothing).unwrap(), "**No gap**: p = 0.40 under noise alone.");
        let left = r#"{"verdict": "unexplained", "gap": {"detected": true}, "closure": {}, "causes": [], "unexplained": {"depends_on": ["w"]}}"#;
        assert_eq!(result(left).unwrap(), "**Unexplained**: the gap depends on `w`.");
    }

    #[test]
    fn a_result_stands_beneath_the_heading_and_is_replaced() {
        let page = with_result("# Arm\n\nWords.\n", "**Explained**: a.");
        assert_eq!(page, "# Arm\n\n**Explained**: a.\n\nWords.\n");
        assert_eq!(with_result(&page, "**No gap**."), "# Arm\n\n**No gap**.\n\nWords.\n");
        let index = "| | page | result |\n| --- | --- | --- |\n| x | [Arm](arm.md): why? | |\n| y | [Fleet](fleet.md): who? | old |\n";
        let done = with_results(index, |name| Some(format!("**{name}**")));
        assert!(
            done.contains("| x | [Arm](arm.md): why? | **arm** |\n| y | [Fleet](fleet.md): who? | **fleet** |\n"),
            "{done}"
        );
        assert!(done.starts_with("| | page | result |\n| --- | --- | --- |\n"), "{done}");
    }

    #[test]
    fn a_fleet_keeps_its_comparison_and_its_picture() {
        let folder = root().join("target/gallery-test");
        let ran = Ran { folder: folder.join("ran"), printed: vec![] };
        let page = folder.join("docs/fleet.md");
        let chart = "<svg viewBox=\"0 0 4 4\" role=\"img\"><title id=\"a\">friction</title><svg x=\"1\"></svg></svg>";
        write(&page, "# Fleet\n\n[its comparison](reports/fleet.json)\n").unwrap();
        write(&ran.folder.join("result/fleet.json"), "{}").unwrap();
        write(&ran.folder.join("result/fleet.html"), &format!("<style>:root {{ }}\n</style>{chart}")).unwrap();
        write(&ran.folder.join("result/tasks/a/report.html"), "").unwrap();
        for (html, link) in [(false, "(reports/fleet.json)"), (true, "(reports/fleet.html)")] {
            keep(&page, "fleet", &ran, html).unwrap();
            assert!(read(&page).unwrap().contains(link));
        }
        for left in ["reports/fleet.json", "reports/fleet.html", "reports/tasks/a/report.html", "pictures/fleet.svg"] {
            assert!(folder.join("docs").join(left).is_file(), "{left}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_picture_is_a_file_of_its_own_with_the_colours_of_its_report() {
        let chart = |title: &str| {
            format!(
                "<svg viewBox=\"0 0 4 4\" role=\"img\"><title id=\"a\">{title}</title><svg x=\"1\"><path/></svg><rect/></svg>"
            )
        };
        let charts = ["v over time", "Residual of v in held-out run 4", "v in held-out run 4"].map(chart).concat();
        let page = format!(
            "<style>:root {{\n  --ink: #111;\n}}\nbody {{ margin: 0 }}\nsvg text {{ fill: var(--ink); }}\n</style><style>svg .odd {{ stroke: red; }}</style>{charts}"
        );
        let drawn = picture(&page, |title| title.contains("in held-out run") && !title.contains("Residual")).unwrap();
        assert!(drawn.contains(">v in held-out run 4<") && drawn.contains("--ink: #111;"), "{drawn}");
        assert!(drawn.contains("svg text") && drawn.contains("svg .odd") && !drawn.contains("body"), "{drawn}");
        assert_eq!(picture(&page, |title| title.contains("pressure")), None);
        assert_eq!((drawn.matches("<svg").count(), drawn.matches("</svg>").count()), (2, 2), "{drawn}");
    }
}
