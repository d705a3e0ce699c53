//! The documentation page of each effect, from the catalogue.

use gpsindy_core::diagnose::Effect;
use std::fmt::Write;

/// The page of one effect, in Markdown; `caption` stands under its picture, `ID.svg` in the same folder.
pub fn effect_page(effect: Effect, caption: &str) -> String {
    let mut page = format!("# {}: `{}`\n\n{}\n\n", capital(effect.name()), effect.id(), effect.meaning());
    let _ = write!(page, "![What {} looks like in a log]({}.svg)\n\n{caption}\n\n", effect.name(), effect.id());
    let mut row = |what: &str, text: &str| {
        let _ = writeln!(page, "| {what} | {} |", text.replace('|', "\\|"));
    };
    row("what", "");
    row("---", "---");
    row("form", &format!("`{}`", effect.form()));
    row("parameters", effect.parameters());
    row("in a log", effect.signature());
    row("acts in", &effect.places().join("; "));
    let sense = effect.sense();
    if !sense.is_empty() {
        row("only if", &sense.join("; "));
    }
    let asked = if effect.is_only_if_asked() { "only if `--effects` names it" } else { "always" };
    row("tested", asked);
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
    let reach = if effect.size_is_a_limit() {
        "A diagnosis reports the limit below which the logs would have revealed it"
    } else {
        "A diagnosis reports the size above which the logs would have revealed it"
    };
    let _ = write!(
        page,
        "\n{reach} (`excluded`), if a single number can state it. `--power` adds it to simulated copies of the logs.\n"
    );
    page
}

/// The page that lists them all.
pub fn effects_index() -> String {
    let mut page = String::from(
        "# The catalogue of effects\n\nThe effects that a diagnosis tests. z is the variable that an effect depends on, u a control.\n`cargo xtask effects` generates these pages from the catalogue.\n\n| effect | form | what it does |\n| --- | --- | --- |\n",
    );
    for effect in Effect::ALL {
        let form = effect.form().replace('|', "\\|");
        let _ = writeln!(page, "| [`{0}`]({0}.md) | `{form}` | {1} |", effect.id(), effect.meaning());
    }
    page
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}
