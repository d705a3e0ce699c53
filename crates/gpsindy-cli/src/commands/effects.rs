//! `gpsindy effects`: the catalogue of effects that a diagnosis tests.

use crate::failure::{Failure, Outcome};
use crate::screen::Screen;
use clap::Args;
use gpsindy_core::diagnose::Effect;
use gpsindy_files::meant;
use serde_json::json;

/// List the effects that a diagnosis tests
///
/// For each effect: its form (added to the right side of the state's equation unless stated otherwise; z is the variable it depends on, u a
/// control), its parameters, and what it looks like in a log. With `--json` also its name, where it can act, the effects that logs may not
/// distinguish from it with the experiment that would, and whether it is tested by default.
#[derive(Debug, Args)]
#[command(before_help = "Example: gpsindy effects\n         gpsindy effects coulomb_friction backlash")]
pub(crate) struct Effects {
    /// Show only these effects
    #[arg(value_name = "ID")]
    ids: Vec<String>,
}

pub(crate) fn run(command: &Effects, screen: &Screen) -> Outcome {
    let mut shown: Vec<Effect> = Vec::new();
    for id in &command.ids {
        let unknown = || {
            let near = meant(id, Effect::ALL.iter().map(|effect| effect.id()));
            Failure::input(format!("effect `{id}` is not in the catalogue{near}; `gpsindy effects` lists all"))
        };
        shown.push(Effect::from_id(id).ok_or_else(unknown)?);
    }
    if shown.is_empty() {
        shown = Effect::ALL.to_vec();
    }
    if screen.json() {
        let list: Vec<_> = shown.into_iter().map(entry).collect();
        return screen.out(&format!("{}\n", json!(list)));
    }
    let mut text = String::new();
    for effect in shown {
        text += &format!("{:<22} {}\n", effect.id(), effect.form());
        text += &format!("{:<22} {}\n{:<22} {}\n\n", "", effect.parameters(), "", effect.signature());
    }
    screen.out(&text)
}

/// All that the catalogue says of an effect.
fn entry(effect: Effect) -> serde_json::Value {
    let twins: Vec<_> = effect
        .twins()
        .into_iter()
        .map(|(twin, experiment)| json!({"effect": twin.id(), "experiment": experiment}))
        .collect();
    json!({
        "id": effect.id(),
        "name": effect.name(),
        "meaning": effect.meaning(),
        "form": effect.form(),
        "parameters": effect.parameters(),
        "signature": effect.signature(),
        "places": effect.places(),
        "sense": effect.sense(),
        "suspect": if effect.is_only_if_asked() { "asked" } else { "always" },
        "suspect_behind": effect.stands_behind().iter().map(|imitator| imitator.id()).collect::<Vec<_>>(),
        "twins": twins,
        "about": effect.about(),
    })
}
