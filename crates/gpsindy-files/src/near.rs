//! Names near one that was not found.

/// Least likeness of a name that is worth a suggestion, of 1: about one letter in three may differ.
const LIKE: f64 = 0.6;

/// Names listed in full; more are only counted.
const LISTED: usize = 16;

/// The names that are most like `name`, best first, at most three.
pub(crate) fn near<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Vec<&'a str> {
    let lower = name.to_lowercase();
    // Of `observation.state[elbow]` the last part is `elbow`.
    let last = |text: &str| text.trim_end_matches(']').rsplit(['.', '/', '[']).next().unwrap_or_default().to_string();
    let mut liked: Vec<(f64, &str)> = Vec::new();
    for other in known {
        let plain = other.to_lowercase();
        let mut likeness = strsim::normalized_damerau_levenshtein(&lower, &plain);
        let (a, b) = (last(&lower), last(&plain));
        if a.len() > 1 && b.len() > 1 {
            likeness = likeness.max(0.95 * strsim::normalized_damerau_levenshtein(&a, &b));
        }
        if likeness >= LIKE && !liked.iter().any(|(_, n)| *n == other) {
            liked.push((likeness, other));
        }
    }
    liked.sort_by(|a, b| b.0.total_cmp(&a.0));
    liked.into_iter().take(3).map(|(_, name)| name).collect()
}

/// `; did you mean `a` or `b`?; found: ...`: the near names, then all of them where they are few.
#[must_use]
pub fn hint<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    format!("{}; found: {}", meant(name, known.iter().copied()), listed(&known))
}

/// `; did you mean `a` or `b`?`: the near names; nothing where there are none.
#[must_use]
pub fn meant<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    question(&near(name, known))
}

/// `; did you mean `a` or `b`?` of these names; nothing where there are none.
pub(crate) fn question(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    if names.is_empty() { String::new() } else { format!("; did you mean {}?", names.join(" or ")) }
}

/// Names in a row, the rest counted where they are many.
pub(crate) fn listed(names: &[&str]) -> String {
    if names.len() > LISTED {
        return format!("{} and {} more", names[..LISTED].join(", "), names.len() - LISTED);
    }
    if names.is_empty() { "nothing".into() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_a_letter_finds_its_name() {
        let known = ["shoulder_pan", "elbow", "wrist"];
        assert_eq!(near("sholder_pan", known), ["shoulder_pan"]);
        assert_eq!(near("Elbow", known), ["elbow"]);
        assert!(near("torque", known).is_empty());
        assert_eq!(
            near("elbo", ["observation.state[wrist]", "observation.state[elbow]"]),
            ["observation.state[elbow]"]
        );
        assert_eq!(
            near("/joint_state", ["/joint_states", "/robot/joint_states"]),
            ["/joint_states", "/robot/joint_states"]
        );
    }

    #[test]
    fn long_lists_are_cut() {
        let many: Vec<String> = (0..20).map(|i| format!("column_{i}")).collect();
        let text = hint("x", many.iter().map(String::as_str));
        assert!(text.ends_with("column_15 and 4 more"), "{text}");
    }
}
