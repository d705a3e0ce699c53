//! Wording shared by the page and the terminal: names of effects, the verdict in a sentence.

use crate::numbers::{fixed, number, p_value, percent, percent_closed, with_unit};
use gpsindy_core::diagnose::Effect;
use gpsindy_core::diagnose::report::{BetweenRuns, Cause, Diagnosis, Excluded, Parameter, Stability, Twin, Verdict};

/// Value and interval of a parameter with the digits that the interval's width supports.
pub(crate) fn interval(parameter: &Parameter) -> (String, Option<String>) {
    let (low, high) = (parameter.low, parameter.high);
    if low.is_none() && high.is_none() {
        return (number(parameter.value), None);
    }
    let width = match (low, high) {
        (Some(low), Some(high)) => (high - low) / 2.0,
        (Some(end), None) | (None, Some(end)) => (parameter.value - end).abs(),
        (None, None) => 0.0,
    };
    let size = [Some(parameter.value), low, high].into_iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
    let plain = width > 0.0 && (1e-3..1e6).contains(&size) && width > size * 1e-6;
    let write = |value: f64| {
        if plain { fixed(value, (1 - width.log10().floor() as i32).clamp(0, 9) as usize) } else { number(value) }
    };
    let range = match (low, high) {
        (Some(low), Some(high)) => format!("{} to {}", write(low), write(high)),
        (Some(low), None) => format!("at least {}", write(low)),
        (None, Some(high)) => format!("at most {}", write(high)),
        (None, None) => String::new(),
    };
    (write(parameter.value), Some(range))
}

/// The effect in everyday words; an id that the catalogue does not know, with spaces.
pub(crate) fn effect_name(id: &str) -> String {
    Effect::from_id(id).map_or_else(|| id.replace('_', " "), |effect| effect.name().into())
}

/// What the effect does, for a reader who meets it first here; empty where the id is a user's own.
pub(crate) fn effect_meaning(id: &str) -> &'static str {
    match id {
        "function" => "Structure in the residual that no effect of the catalogue describes.",
        _ => Effect::from_id(id).map_or("", Effect::meaning),
    }
}

/// The effect and what it depends on: `Coulomb friction`, `wrong parameter b`, `input delay of u`.
pub(crate) fn cause_name(cause: &Cause) -> String {
    let name = effect_name(&cause.effect);
    let variables = cause.variables.join(", ");
    if variables.is_empty() || variables == cause.state {
        return name;
    }
    with_variables(&cause.effect, &name, &variables)
}

/// The effect and what it acts on or depends on.
pub(crate) fn with_variables(effect: &str, name: &str, variables: &str) -> String {
    match Effect::from_id(effect) {
        Some(Effect::ParameterError) => format!("{name} {variables}"),
        Some(effect) if effect.acts_on_input() || effect.acts_on_parameter() => format!("{name} of {variables}"),
        _ => format!("{name} ({variables})"),
    }
}

/// An excluded effect, what it would depend on, and where: `cubic stiffness (x) in the equation of v`.
pub(crate) fn excluded_name(row: &Excluded) -> String {
    let name = effect_name(&row.effect);
    let variables = row.variables.join(", ");
    let is_plain = variables.is_empty() || variables == row.state;
    let name = if is_plain { name } else { with_variables(&row.effect, &name, &variables) };
    let place = place_of(&row.effect, &row.state, row.place.as_deref(), &row.variables);
    format!("{name} {place}").trim_end().to_string()
}

/// Where an effect acts: in an equation, at a port, or in a logged column for a sensor effect. A control at which it acts is among its
/// variables. The name of an element's own parameter, `elbow.damping`, says where it is.
fn place_of(effect: &str, state: &str, place: Option<&str>, variables: &[String]) -> String {
    let port = place.filter(|place| !variables.iter().any(|name| name == place));
    let is_of_element =
        || Effect::from_id(effect) == Some(Effect::ParameterError) && variables.iter().any(|v| v.contains('.'));
    match port {
        _ if is_of_element() => String::new(),
        _ if Effect::from_id(effect).is_some_and(Effect::acts_on_sensor) => format!("in the column {state}"),
        Some(port) => format!("at {port}"),
        None => format!("in the equation of {state}"),
    }
}

/// Parts of the logs in which a cause's size agrees, in a sentence.
pub(crate) fn stability_sentence(stability: &Stability) -> String {
    let agree = format!("Its fitted size agrees in {} of {} parts of the logs", stability.agree, stability.runs);
    let chance = p_value(stability.p_value);
    if stability.disagree.is_empty() {
        format!("{agree} ({chance}).")
    } else {
        format!("{agree} ({chance}), not in {}.", listed(&stability.disagree, "and"))
    }
}

/// What else explains as much as a cause, by name; with place and size where they are known.
pub(crate) fn equivalents(cause: &Cause) -> Vec<String> {
    let is_twin = |id: &String| cause.twins.iter().any(|twin| twin.effect == *id);
    let others = cause.equivalent.iter().filter(|id| **id != cause.effect && !is_twin(id)).map(|id| effect_name(id));
    cause.twins.iter().map(twin_name).chain(others).collect()
}

/// A twin with its size: `wrong parameter elbow.damping (0.5 N m s)`.
fn twin_name(twin: &Twin) -> String {
    let name = effect_name(&twin.effect);
    let variables = twin.variables.join(", ");
    let is_parameter = Effect::from_id(&twin.effect) == Some(Effect::ParameterError);
    let name = if variables.is_empty() { name } else { with_variables(&twin.effect, &name, &variables) };
    let size = twin.parameters.first().map(|p| format!(" ({})", with_unit(&interval(p).0, &p.unit)));
    let place = if is_parameter {
        String::new()
    } else {
        format!(" {}", place_of(&twin.effect, &twin.state, twin.place.as_deref(), &twin.variables))
    };
    name + &place + &size.unwrap_or_default()
}

/// One of the sizes, as a parameter.
pub(crate) fn size_of(between: &BetweenRuns, value: f64, low: f64, high: f64) -> Parameter {
    let (name, unit) = (between.parameter.clone(), between.unit.clone());
    Parameter { name, value, low: Some(low), high: Some(high), unit }
}

/// A size by run and pooled: `By run: c = 0.2, 0.3; pooled 0.25 (0.1 to 0.4). 92 % of that spread is the machine's.`
pub(crate) fn between_sentence(between: &BetweenRuns) -> String {
    let runs: Vec<String> =
        between.runs.iter().map(|run| interval(&size_of(between, run.value, run.low, run.high)).0).collect();
    let (pooled, range) = interval(&size_of(between, between.pooled, between.low, between.high));
    let range = range.map(|range| format!(" ({range})")).unwrap_or_default();
    let spread = if between.spread > 0.0 {
        let size = with_unit(&number(between.spread), &between.unit);
        format!(
            "{} of the spread is the machine's own ({size} from run to run, {})",
            percent(between.share),
            p_value(between.p_value)
        )
    } else {
        format!("the runs differ by no more than the fit's own error ({})", p_value(between.p_value))
    };
    format!(
        "By run: {} = {}; pooled {pooled}{range}; {spread}.",
        between.parameter,
        with_unit(&runs.join(", "), &between.unit)
    )
}

/// What a parameter means at its value, where the form that is shown does not hold it: ` (speed within which the sign is smoothed)`.
pub(crate) fn parameter_meaning(cause: &Cause, parameter: &Parameter) -> String {
    let name = parameter.name.as_str();
    let is_shown = cause.form.split(|c: char| !c.is_alphanumeric() && c != '_').any(|word| word == name);
    let stated = Effect::from_id(&cause.effect).filter(|_| !is_shown).and_then(|effect| {
        effect.parameters().split(", ").find_map(|one| one.split_once(": ").filter(|(own, _)| *own == name))
    });
    let Some((_, meaning)) = stated else { return String::new() };
    // A value of zero may have a meaning of its own.
    let (usual, at_zero) = meaning.split_once("; 0 where it ").unwrap_or((meaning, meaning));
    format!(" ({})", if parameter.value == 0.0 { at_zero } else { usual })
}

/// How sure it is that structure is left and not only noise, how much of the gap it makes up and what it depends on.
pub(crate) fn left_sentence(report: &Diagnosis) -> String {
    let left = &report.unexplained;
    let probability = percent(left.probability);
    let depends = if left.depends_on.is_empty() {
        String::new()
    } else {
        format!(" It depends on {}.", listed(&left.depends_on, "and"))
    };
    // The share is what the best set of effects leaves in the fitted logs: without causes it is of no model that is reported, and
    // structure that only held-out rollouts show has none.
    let is_missed = report.checks.iter().any(|check| check.id == "closure" && !check.passed);
    let share = if report.included().next().is_none() {
        String::new()
    } else if left.share >= 0.005 {
        format!(" It makes up {} of the gap.", percent(left.share))
    } else if left.probability >= 0.5 && !is_missed {
        " In the fitted logs it is below 1\u{a0}% of the gap.".into()
    } else if left.probability >= 0.5 {
        " It shows in the held-out rollouts; in the fitted logs it is below 1\u{a0}% of the gap.".into()
    } else {
        String::new()
    };
    format!("Unmodelled structure remains with a probability of {probability}.{share}{depends}")
}

/// Where the cause acts: an equation, a port, or a logged column for a sensor effect.
pub(crate) fn cause_place(cause: &Cause) -> String {
    place_of(&cause.effect, &cause.state, cause.place.as_deref(), &cause.variables)
}

/// The equations that the causes act in, with each named once: `friction and drag in the equation of v; bias in that of w`.
fn causes_by_place(report: &Diagnosis) -> String {
    let mut places: Vec<(String, Vec<String>)> = Vec::new();
    for cause in report.included() {
        let place = cause_place(cause);
        match places.iter_mut().find(|(known, _)| *known == place) {
            Some((_, names)) => names.push(cause_name(cause)),
            None => places.push((place, vec![cause_name(cause)])),
        }
    }
    let all: Vec<String> = places
        .into_iter()
        .map(|(place, names)| format!("{} {place}", listed(&names, "and")).trim_end().to_string())
        .collect();
    listed(&all, "and")
}

/// `a`, `a and b`, `a, b and c`.
pub(crate) fn listed(items: &[String], last: &str) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [rest @ .., end] => format!("{} {last} {end}", rest.join(", ")),
    }
}

/// The verdict in two or three words.
pub(crate) fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoGap => "No gap",
        Verdict::Explained => "Explained",
        Verdict::PartlyExplained => "Partly explained",
        _ => "Unexplained",
    }
}

/// The verdict in a sentence, with the causes by name.
pub(crate) fn verdict_sentence(report: &Diagnosis) -> String {
    let causes = causes_by_place(report);
    let model = if report.model.is_empty() { "the model".into() } else { format!("the model {}", report.model) };
    let place = report.gap.by_state.first().map_or(String::new(), |s| format!(" in the equation of {}", s.state));
    let depends = if report.unexplained.depends_on.is_empty() {
        String::new()
    } else {
        format!(" that depends on {}", listed(&report.unexplained.depends_on, "and"))
    };
    let differs = report.included().any(|c| c.stability.as_ref().is_some_and(|s| !s.disagree.is_empty()));
    let rest = if report.unexplained.probability >= 0.5 {
        format!("Unmodelled structure{depends} remains.")
    } else if differs {
        "The fitted sizes differ between parts of the logs, so another effect may be the true cause.".into()
    } else if report.is_cut() {
        "The search ended before all was tried, so another effect may be the true cause.".into()
    } else {
        "An effect outside the catalogue may be the true cause.".into()
    };
    let asked = if report.by_part.iter().all(|part| part.asked) { Vec::new() } else { asked_parts(report) };
    let none = match report.is_cut() {
        true => "no effect that was tried before the search ended explains it".into(),
        false if !asked.is_empty() => {
            format!("no effect in {} explains it; nothing else was a suspect", listed(&asked, "or"))
        }
        false => "no effect of the catalogue explains it".to_string(),
    };
    match report.verdict {
        Verdict::NoGap => format!("Measurement noise alone explains the difference between {model} and the logs."),
        Verdict::Explained if causes.is_empty() => format!("The gap between {model} and the logs is explained."),
        Verdict::Explained => format!("The gap between {model} and the logs is explained by {causes}."),
        Verdict::PartlyExplained if causes.is_empty() => {
            format!("Part of the gap between {model} and the logs is explained. {rest}")
        }
        Verdict::PartlyExplained => {
            format!("Part of the gap between {model} and the logs is explained by {causes}. {rest}")
        }
        // Nothing was asked of a gap yet: what the closure shows is all that is known.
        Verdict::Unexplained if report.is_undecided() => {
            let missed = report.closure.before.map_or(String::new(), |before| {
                format!(" Rollouts of {model} miss the held-out logs by {} times the noise.", number(before))
            });
            format!("The search ended before it could decide whether there is a gap.{missed}")
        }
        Verdict::Unexplained if depends.is_empty() => {
            format!("There is a gap{place}, and {none}.")
        }
        _ => format!("There is a gap{place}{depends}, and {none}."),
    }
}

/// Parts of the machine that alone were suspects.
fn asked_parts(report: &Diagnosis) -> Vec<String> {
    report.by_part.iter().filter(|part| part.asked).map(|part| part.part.clone()).collect()
}

/// Whether a cause is random: a statement about its row that changes no equation.
pub(crate) fn is_random(cause: &Cause) -> bool {
    Effect::from_id(&cause.effect).is_some_and(Effect::is_random)
}

/// How much of the gap the included causes close, over which horizon, in a sentence.
pub(crate) fn closure_sentence(report: &Diagnosis, time_unit: &str) -> String {
    let closure = &report.closure;
    let range = match (closure.low, closure.high) {
        (Some(low), Some(high)) if percent_closed(low) != percent_closed(high) => {
            format!(" ({} interval {} to {})", percent(report.level()), percent_closed(low), percent_closed(high))
        }
        _ => String::new(),
    };
    let runs = closure.horizon.map_or_else(
        || "On held-out runs".to_string(),
        |s| format!("On held-out runs, in rollouts of {}", with_unit(&number(s), time_unit)),
    );
    if report.verdict == Verdict::NoGap {
        return "There is no gap to close.".into();
    }
    if report.included().next().is_none() {
        return "No cause is included, so none of the gap is closed.".into();
    }
    if let Some(spread) = closure.spread {
        return format!(
            "{runs}, no rollout follows a random force, so little of the gap can close; {} of the errors lie within the predicted \
             95\u{a0}% band.",
            percent(spread)
        );
    }
    match closure.closed {
        Some(closed) if closed < 0.0 => {
            format!(
                "{runs}, the augmented model is worse than the nominal one: {} of the gap is closed{range}.",
                percent_closed(closed)
            )
        }
        // Only chance carries a closure beyond everything.
        Some(closed) if closed >= 0.9995 => format!("{runs}, all of the gap above the noise is closed{range}."),
        Some(closed) => format!("{runs}, {} of the gap is closed{range}.", percent_closed(closed)),
        None if closure.before.is_none() && closure.after.is_some() => {
            format!("{runs}, the nominal model diverges; the augmented one does not.")
        }
        None if closure.after.is_none() => format!("{runs}, the augmented model diverges."),
        None => "How much of the gap is closed cannot be determined.".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_shows_the_digits_that_its_width_supports() {
        let parameter = |value, low, high| Parameter { name: "c".into(), value, low, high, unit: String::new() };
        assert_eq!(
            interval(&parameter(0.312, Some(0.2912), Some(0.3342))),
            ("0.312".into(), Some("0.291 to 0.334".into()))
        );
        assert_eq!(interval(&parameter(40.0, Some(10.0), None)), ("40".into(), Some("at least 10".into())));
        assert_eq!(interval(&parameter(40.0, None, None)), ("40".into(), None));
        assert_eq!(interval(&parameter(2e-8, Some(1e-8), Some(3e-8))), ("2e-8".into(), Some("1e-8 to 3e-8".into())));
    }

    #[test]
    fn a_parameter_that_the_form_does_not_show_says_what_it_is() {
        let json = r#"{"effect": "coulomb_friction", "state": "v", "variables": ["v"], "included": true, "probability": 0.9,
            "form": "-c*sign(v)", "parameters": [], "equivalent": [], "next_experiment": null}"#;
        let cause: Cause = serde_json::from_str(json).unwrap();
        let meaning = |cause: &Cause, name: &str, value: f64| {
            let parameter = Parameter { name: name.into(), value, low: None, high: None, unit: String::new() };
            parameter_meaning(cause, &parameter)
        };
        assert_eq!(meaning(&cause, "c", 2.0), "");
        assert_eq!(meaning(&cause, "w", 0.1), " (speed within which the sign is smoothed)");
        assert_eq!(meaning(&cause, "w", 0.0), " (holds at rest)");
        assert_eq!(meaning(&Cause { effect: "tyre_slip".into(), ..cause }, "w", 0.1), "");
    }

    #[test]
    fn an_effect_at_a_port_is_told_there_and_not_in_the_equation_that_it_moves_most() {
        let name = |json: &str| excluded_name(&serde_json::from_str(json).unwrap());
        let row = r#""state": "elbow_vel", "above": 0.1, "unit": "N m""#;
        assert_eq!(
            name(&format!(r#"{{"effect": "bias", "place": "shoulder_torque", {row}}}"#)),
            "constant bias at shoulder_torque"
        );
        let delay = format!(r#"{{"effect": "input_delay", "place": "servo", "variables": ["servo"], {row}}}"#);
        assert_eq!(name(&delay), "input delay of servo in the equation of elbow_vel");
        let damping = format!(r#"{{"effect": "parameter_error", "variables": ["elbow.damping"], {row}}}"#);
        assert_eq!(name(&damping), "wrong parameter elbow.damping");
    }

    #[test]
    fn a_search_that_ended_before_it_looked_for_a_gap_claims_none() {
        let json = r#"{"schema": "gpsindy.diagnosis/1", "model": "arm", "runs": {"train": [], "holdout": []}, "verdict": "unexplained",
            "gap": {"detected": false, "p_value": 1, "by_state": [], "by_region": [], "by_window": []}, "causes": [], "excluded": [],
            "unexplained": {"probability": 0, "share": 0, "depends_on": []}, "interrupted": 120, "notes": [],
            "closure": {"metric": "rollout_rmse", "before": 80.2, "floor_source": "sensor noise", "by_state": []}}"#;
        let stated = verdict_sentence(&serde_json::from_str(json).unwrap());
        assert!(stated.starts_with("The search ended before") && stated.contains("80.2 times the noise"), "{stated}");
    }

    #[test]
    fn an_id_of_a_user_s_own_effect_reads_as_words() {
        assert_eq!(effect_name("tyre_slip"), "tyre slip");
        assert_eq!(effect_meaning("tyre_slip"), "");
    }
}
