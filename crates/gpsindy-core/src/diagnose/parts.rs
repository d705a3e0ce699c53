//! Parts of the machine by name: joints and actuators, to ask about some of them only and to sum up by them.

use crate::error::{Error, Result};
use crate::model::Model;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// What kind of part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum PartKind {
    /// A joint with the actuators that drive it.
    Joint,
    /// An actuator: its command and its gains.
    Actuator,
}

impl PartKind {
    /// The kind in a word.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Actuator => "actuator",
        }
    }
}

/// A part of the machine, and what of the model belongs to it; one thing may belong to several parts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// What it is.
    pub kind: PartKind,
    /// As its simulator calls it.
    pub name: String,
    /// Names of its states.
    pub states: Vec<String>,
    /// Names of the controls that move it.
    pub controls: Vec<String>,
    /// Names of the ports at which forces act on it.
    pub ports: Vec<String>,
    /// Names of its parameters.
    pub parameters: Vec<String>,
}

impl Part {
    /// The part of this kind and name.
    ///
    /// # Errors
    /// No such part: names of the others of its kind, the nearest one first.
    pub fn find<'a>(parts: &'a [Self], kind: PartKind, name: &str) -> Result<&'a Self> {
        let alike = || parts.iter().filter(move |part| part.kind == kind);
        let found = alike().find(|part| part.name == name);
        found.ok_or_else(|| Error::unknown(kind.as_str(), name, alike().map(|part| part.name.as_str())))
    }

    /// Whether an effect belongs to it: at a port or control `place`, else by the first control or parameter among its `variables`,
    /// else in the equation or column of `state`.
    pub(crate) fn has(&self, model: &Model, place: Option<&str>, variables: &[String], state: &str) -> bool {
        let in_any = |name: &str, lists: &[&[String]]| lists.iter().any(|list| list.iter().any(|own| own == name));
        if let Some(place) = place {
            return in_any(place, &[&self.ports, &self.controls]);
        }
        let is_input = |name: &&String| model.control_index(name).is_some() || model.parameter_index(name).is_some();
        match variables.iter().find(is_input) {
            Some(name) => in_any(name, &[&self.controls, &self.parameters]),
            None => in_any(state, &[&self.states]),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub(crate) mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::{Control, Parameter, State};

    fn names(all: &[&str]) -> Vec<String> {
        all.iter().map(|name| (*name).to_string()).collect()
    }

    fn joint(name: &str) -> Part {
        Part {
            kind: PartKind::Joint,
            name: name.into(),
            states: vec![name.into(), format!("{name}_vel")],
            controls: vec![format!("{name}_ctrl")],
            ports: vec![format!("{name}_torque")],
            parameters: vec![format!("{name}.damping")],
        }
    }

    #[test]
    fn an_effect_belongs_to_the_part_whose_port_control_parameter_or_state_it_is_at() {
        let mut model = Model::default();
        for name in ["hip", "hip_vel", "knee", "knee_vel"] {
            model.states.push(State::new(name, Expression::Pi));
        }
        model.controls = vec![Control::new("hip_ctrl"), Control::new("knee_ctrl")];
        model.parameters.push(Parameter::new("hip.damping", 0.1));
        let (hip, knee) = (joint("hip"), joint("knee"));
        let of = |place: Option<&str>, variables: &[&str], state: &str| {
            [&hip, &knee].map(|part| part.has(&model, place, &names(variables), state))
        };
        // Coupling acts where it acts, whatever it reads.
        assert_eq!(of(Some("hip_torque"), &["knee_vel"], "hip_vel"), [true, false]);
        assert_eq!(of(None, &["knee_ctrl"], "hip_vel"), [false, true]);
        assert_eq!(of(None, &["hip.damping"], "knee_vel"), [true, false]);
        assert_eq!(of(None, &["knee"], "knee"), [false, true]);
    }

    #[test]
    fn a_part_that_is_not_there_is_an_error_with_the_names_of_its_kind() {
        let parts = [joint("hip"), joint("knee")];
        assert_eq!(Part::find(&parts, PartKind::Joint, "knee").unwrap().name, "knee");
        let stated = Part::find(&parts, PartKind::Joint, "kne").unwrap_err().to_string();
        assert!(stated.contains("joint `kne`") && stated.contains("knee"), "{stated}");
        assert!(Part::find(&parts, PartKind::Actuator, "knee").is_err());
    }
}
