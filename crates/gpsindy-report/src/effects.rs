//! A page of documentation of each effect, from the catalogue.

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
    row("its numbers", effect.parameters());
    row("in a log", effect.signature());
    row("acts in", &effect.places().join("; "));
    let sense = effect.sense();
    if !sense.is_empty() {
        row("only where", &sense.join("; "));
    }
    let asked = if effect.is_only_if_asked() { "only where `--effects` names it" } else { "always" };
    row("a suspect", asked);
    if !effect.about().is_empty() {
        let _ = write!(page, "\n{}\n", effect.about());
    }
    let twins = effect.twins();
    if !twins.is_empty() {
        page += "\nWhat logs may not tell from it, and the experiment that parts the two:\n\n";
        for (twin, experiment) in twins {
            let _ = writeln!(page, "- [{}]({}.md): {experiment}", twin.name(), twin.id());
        }
    }
    let reach = if effect.size_is_a_limit() {
        "A diagnosis says above which limit it would not have shown in these logs"
    } else {
        "A diagnosis says above which size it would have shown in these logs"
    };
    let _ = write!(
        page,
        "\n{reach} (`excluded`), where one number can say so; `--power` plants it in copies of the logs.\n"
    );
    page
}

/// The page that lists them all.
pub fn effects_index() -> String {
    let mut page = String::from(
        "# The catalogue of effects\n\nWhat a diagnosis looks for; z is the variable that an effect depends on, u a control.\nMade from the catalogue by `cargo xtask effects`.\n\n| effect | form | what it does |\n| --- | --- | --- |\n",
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
