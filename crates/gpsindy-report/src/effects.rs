//! The documentation page of each effect, from the catalogue and from the cases of the gallery that named it.

use gpsindy_core::diagnose::Effect;
use std::fmt::Write;

/// A page of the gallery, and the effects that its diagnosis named.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GalleryCase {
    /// Name of the page without its ending.
    pub file: String,
    /// Its heading.
    pub title: String,
    /// The effects that its result links to.
    pub effects: Vec<Effect>,
}

impl GalleryCase {
    /// The case of the page `file`, out of its Markdown. The result is the first line in bold; nothing for a page without one.
    pub fn of(file: &str, page: &str) -> Option<Self> {
        let title = page.lines().find_map(|line| line.strip_prefix("# "))?;
        let result = page.lines().find(|line| line.starts_with("**"))?;
        let links = result.split("](../effects/").skip(1).filter_map(|link| link.split(".md)").next());
        Some(Self { file: file.into(), title: title.into(), effects: links.filter_map(Effect::from_id).collect() })
    }
}

/// The page of one effect, in Markdown; `caption` goes under its picture, `ID.svg` in the same folder.
///
/// Of `cases` it links to those that named the effect.
pub fn effect_page(effect: Effect, caption: &str, cases: &[GalleryCase]) -> String {
    let mut page = format!("# {}: `{}`\n\n{}\n\n", capital(effect.name()), effect.id(), effect.meaning());
    let _ = write!(page, "![What {} looks like in a log]({}.svg)\n\n{caption}\n\n", effect.name(), effect.id());
    let mut row = |what: &str, text: &str| {
        let _ = writeln!(page, "| {what} | {} |", cell(text));
    };
    row("what", "");
    row("---", "---");
    row("in a log", effect.signature());
    row("form", &format!("`{}`", effect.form()));
    row("parameters", effect.parameters());
    row("acts in", &effect.places().join("; "));
    let sense = effect.sense();
    if !sense.is_empty() {
        row("only if", &sense.join("; "));
    }
    let asked = match (effect.is_only_if_asked(), effect.stands_behind()) {
        (false, _) => "always".to_string(),
        (true, []) => "only if `--effects` names it".to_string(),
        (true, imitators) => {
            let linked: Vec<String> = imitators.iter().map(|i| format!("[{}]({}.md)", i.name(), i.id())).collect();
            format!("if `--effects` names it, and where {} leads the search in the same place", linked.join(" or "))
        }
    };
    row("tested", &asked);
    row("in `augmented.toml`", &exported(effect));
    row("in a MuJoCo model", effect.in_mjcf().unwrap_or("a comment at the top"));
    if !effect.about().is_empty() {
        let _ = write!(page, "\n{}\n", effect.about());
    }
    let twins = effect.twins();
    if !twins.is_empty() {
        page += "\nEffects that logs may not distinguish from it, and the experiment that would:\n\n";
        for (twin, experiment) in twins {
            let _ = writeln!(page, "- [{}]({}.md): {experiment}", twin.name(), twin.id());
        }
    }
    let named: Vec<String> = cases
        .iter()
        .filter(|case| case.effects.contains(&effect))
        .map(|case| format!("[{}](../gallery/{}.md)", case.title, case.file))
        .collect();
    if !named.is_empty() {
        let _ = write!(page, "\nNamed in the gallery: {}.\n", named.join(", "));
    }
    page + "\n" + &reach(effect) + "\n"
}

/// What a diagnosis says of an effect that it did not find.
fn reach(effect: Effect) -> String {
    if effect.is_random() {
        // Nothing is planted: it has no form that a rollout could follow.
        return "A diagnosis states no size above which the logs would have revealed it, and `--power` does not add it to copies of the logs."
            .into();
    }
    let size = if effect.size_is_a_limit() { "limit below" } else { "size above" };
    let asked = if effect.is_only_if_asked() { " if `--effects` names it and" } else { " if" };
    format!(
        "A diagnosis reports the {size} which the logs would have revealed it (`excluded`), if a single number can state it. `--power` \
         adds it to simulated copies of the logs{asked} they move what it depends on."
    )
}

/// The page that lists them all by what a reader sees first: the log.
pub fn effects_index() -> String {
    let mut page = String::from(
        "# What you see in the log\n\n\
         The effects that a diagnosis tests, by their symptoms. A diagnosis tests all of them at once:\n\n\
         ```sh\ngpsindy diagnose simulator.toml run_*.csv --out diagnosis\n```\n\n\
         The third column restricts it to one effect. An effect marked * is tested only if `--effects` names it, or where its page says so. The last column says what the \
         corrected simulator then has: `augmented.toml`, and `augmented.xml` of a MuJoCo model where it has a field for the effect. Any other \
         effect is a comment at the top of `augmented.xml`, or in an FMU's `augmented.ssv`. z and w are the variables that an effect depends \
         on, u a control, p a term or a parameter. `cargo xtask effects` generates these pages from the catalogue.\n\n\
         | what you see in the log | effect | add to the command | what is exported |\n| --- | --- | --- | --- |\n",
    );
    for effect in Effect::ALL {
        let mark = if effect.is_only_if_asked() { " *" } else { "" };
        let field = effect.in_mjcf().map_or(String::new(), |field| format!("; MuJoCo: {field}"));
        let _ = writeln!(
            page,
            "| {} | [{}]({}.md){mark} | `--effects {}` | {}{field} |",
            cell(&capital(effect.signature())),
            effect.name(),
            effect.id(),
            effect.id(),
            cell(&exported(*effect)),
        );
    }
    page
}

/// What the corrected equations have of an effect.
fn exported(effect: Effect) -> String {
    let form = effect.form();
    if effect.is_random() {
        "nothing; intensity and correlation time are in `report.json`".into()
    } else if effect.acts_on_sensor() {
        format!("`measured`: {}", quoted(form.trim_start_matches("the column reads ")))
    } else if effect.id() == "parameter_error" {
        "the parameter's new `value`".into()
    } else if is_words(form) || form.contains(" becomes ") {
        quoted(form)
    } else {
        format!("in the row: {}", quoted(form))
    }
}

/// A form with its formulas as code. One that is a sentence stays as it is, and so does what explains a formula.
fn quoted(form: &str) -> String {
    if is_words(form) {
        return form.into();
    }
    let end = form.find(", with ").or_else(|| form.find(" with ")).unwrap_or(form.len());
    let (formula, more) = form.split_at(end);
    match formula.split_once(" becomes ") {
        Some((left, right)) => format!("`{left}` becomes `{right}`{more}"),
        None => format!("`{formula}`{more}"),
    }
}

/// Whether a form is a sentence and no formula.
fn is_words(form: &str) -> bool {
    ["a ", "the ", "u becomes a "].into_iter().any(|start| form.starts_with(start))
}

fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}
