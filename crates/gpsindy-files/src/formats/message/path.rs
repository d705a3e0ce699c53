//! The path to a field: `/joint_states.position[shoulder_pan]` is a topic, then fields and elements.

use crate::near::{near, question};

/// One step from a message to a field in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Step {
    /// A field by its name.
    Field(String),
    /// An element of an array: its index, or its name in the message's own list of names.
    Item(String),
}

/// Cuts a path behind the longest topic that it begins with.
///
/// # Errors
/// The message for the user, where no topic fits.
pub(crate) fn split<'a>(text: &str, topics: &[&'a str]) -> Result<(&'a str, Vec<Step>), String> {
    let fits =
        |topic: &&&str| text.strip_prefix(**topic).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']));
    let Some(topic) = topics.iter().filter(fits).max_by_key(|topic| topic.len()) else {
        let own = text.split(['.', '[']).next().unwrap_or_default();
        // Near the topic as written, or with the slash that was forgotten.
        let with_slash = format!("/{own}");
        let mut liked = near(own, topics.iter().copied());
        liked.extend(topics.iter().filter(|t| **t == with_slash));
        liked.dedup();
        return Err(format!("there is no topic `{own}`{}; found: {}", question(&liked), topics.join(", ")));
    };
    let steps = steps(&text[topic.len()..])?;
    if steps.is_empty() {
        return Err(format!("`{text}` is a whole topic; name a field of it, `{text}.FIELD`"));
    }
    Ok((topic, steps))
}

/// The steps of `.pose.position.x` or `.position[shoulder_pan]`.
pub(crate) fn steps(text: &str) -> Result<Vec<Step>, String> {
    let mut steps = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        if let Some(behind) = rest.strip_prefix('[') {
            let Some(end) = behind.find(']') else { return Err(format!("`{text}` lacks a closing `]`")) };
            steps.push(Step::Item(behind[..end].trim().into()));
            rest = &behind[end + 1..];
            continue;
        }
        let behind = rest.strip_prefix('.').unwrap_or(rest);
        let end = behind.find(['.', '[']).unwrap_or(behind.len());
        if end == 0 {
            return Err(format!("`{text}` has a step without a name"));
        }
        steps.push(Step::Field(behind[..end].into()));
        rest = &behind[end..];
    }
    Ok(steps)
}

/// The steps as text: `pose.position.x`.
pub(crate) fn shown(steps: &[Step]) -> String {
    let mut text = String::new();
    for step in steps {
        match step {
            Step::Field(name) if text.is_empty() => text += name,
            Step::Field(name) => text += &format!(".{name}"),
            Step::Item(item) => text += &format!("[{item}]"),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_a_topic_and_steps() {
        let topics = ["/joint_states", "/joint_states/raw", "/odom", "vehicle.imu"];
        let cut = |text| split(text, &topics).map(|(topic, steps)| format!("{topic} {}", shown(&steps)));
        assert_eq!(cut("/joint_states.position[shoulder.pan]").unwrap(), "/joint_states position[shoulder.pan]");
        assert_eq!(cut("/joint_states/raw.data[0]").unwrap(), "/joint_states/raw data[0]");
        assert_eq!(cut("/odom.pose.pose.position.x").unwrap(), "/odom pose.pose.position.x");
        assert_eq!(cut("vehicle.imu.x[0][1]").unwrap(), "vehicle.imu x[0][1]");
        assert!(cut("/odom").unwrap_err().contains("is a whole topic"));
        assert!(cut("/odom.pose[0").unwrap_err().contains("closing"));
        assert!(cut("/odom.pose..x").unwrap_err().contains("without a name"));
        assert!(cut("odom.pose").unwrap_err().contains("did you mean `/odom`?"));
        assert!(cut("/joint_state.position[0]").unwrap_err().contains("did you mean `/joint_states`"));
    }
}
