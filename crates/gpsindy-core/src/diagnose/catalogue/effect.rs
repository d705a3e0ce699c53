//! The public interface of effects.

use crate::diagnose::catalogue::definition::{Definition, experiment};
use crate::diagnose::catalogue::example::Example;
use crate::diagnose::catalogue::form::{with_words, written};
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::sense::slipping::is_of_a_difference;
use crate::expression::Expression;
use crate::model::Model;

impl Effect {
    /// Its name in everyday words.
    pub fn name(self) -> &'static str {
        self.definition().name
    }

    /// What it does, for a reader who meets it first in a report.
    pub fn meaning(self) -> &'static str {
        self.definition().meaning
    }

    /// What it adds to the right side of the state's equation, or does to the input or the sensor.
    pub fn form(self) -> &'static str {
        self.definition().form
    }

    /// Its parameters in words.
    pub fn parameters(self) -> &'static str {
        self.definition().parameters
    }

    /// What it looks like in a log.
    pub fn signature(self) -> &'static str {
        self.definition().signature
    }

    /// Effects of one family share their prior odds, so that large families do not win by number.
    pub fn family(self) -> Family {
        self.definition().family
    }

    /// Effects that logs may not distinguish from this one, each with the experiment that distinguishes the two.
    pub fn twins(self) -> Vec<(Self, &'static str)> {
        let own = self.definition().twins.iter().copied();
        let others = Self::ALL.iter().copied().filter(|other| *other != self);
        let theirs = others.flat_map(|other| {
            let names_this = other.definition().twins.iter().filter(move |(twin, _)| *twin == self);
            names_this.map(move |(_, experiment)| (other, *experiment))
        });
        let mut all: Vec<(Self, &'static str)> = Vec::new();
        for (twin, experiment) in own.chain(theirs) {
            if !all.iter().any(|(known, _)| *known == twin) {
                all.push((twin, experiment));
            }
        }
        all
    }

    /// Where it can act, in words.
    pub fn places(self) -> Vec<&'static str> {
        self.definition().places.iter().map(|place| place.words()).collect()
    }

    /// What must hold there for it to be a suspect, in words; empty where nothing must.
    pub fn sense(self) -> Vec<&'static str> {
        self.definition().sense.iter().map(|sense| sense.words()).collect()
    }

    /// What it looks like, on a machine of one or two axes.
    pub fn example(self) -> &'static Example {
        &self.definition().example
    }

    /// The field of an MJCF file that carries it, in Markdown, if there is one.
    pub fn in_mjcf(self) -> Option<&'static str> {
        self.definition().in_mjcf
    }

    /// How it is fitted, where it fails, where the form comes from; may be empty.
    pub fn about(self) -> &'static str {
        self.definition().about
    }

    /// Whether it is itself what makes a place unlike others.
    pub(crate) fn marks_a_place(self) -> bool {
        self.definition().traits.marks_a_place
    }

    /// Whether it is a suspect only where a setting names it.
    pub fn is_only_if_asked(self) -> bool {
        self.definition().traits.only_if_asked
    }

    /// Effects that imitate it: where one of them leads the search in the same equation, this one is a suspect there, too, named or not.
    pub fn stands_behind(self) -> &'static [Self] {
        self.definition().traits.behind
    }

    /// Whether it is random, so that no rollout can follow it.
    pub fn is_random(self) -> bool {
        self.acts_at(Place::Random)
    }

    /// Whether the effect acts on a control.
    pub fn acts_on_input(self) -> bool {
        [Place::Control, Place::DriveAndSpeed, Place::Supply].into_iter().any(|place| self.acts_at(place))
    }

    /// Whether the effect acts on what a column reads.
    pub fn acts_on_sensor(self) -> bool {
        self.acts_at(Place::Sensor)
    }

    /// Whether a report names it by the parameter that it changes.
    pub fn acts_on_parameter(self) -> bool {
        self.acts_at(Place::Parameter) || self.acts_at(Place::Heated)
    }

    /// Those of a hypothesis' variables that a report lists: what a rate or a force saturates with, not the parameter of its term, and the
    /// parameter that warms up, not what heats it. The form names the others.
    pub(crate) fn stated(self, variables: &[String]) -> &[String] {
        let first = variables.len().min(1);
        if self.acts_at(Place::Rate) || self.acts_at(Place::Contact) {
            &variables[first..]
        } else if self.acts_at(Place::Heated) {
            &variables[..first]
        } else {
            variables
        }
    }

    pub(crate) fn acts_at(self, place: Place) -> bool {
        self.definition().places.contains(&place)
    }

    /// Effects that it becomes where one of its parameters does nothing.
    pub(crate) fn contains(self) -> &'static [Self] {
        self.definition().traits.contains
    }

    /// How many states it adds to a model.
    pub(crate) fn added_states(self) -> usize {
        self.definition().traits.added_states
    }

    /// Whether it reads a state before the log begins, so that what the machine did then matters.
    pub(crate) fn reads_the_past(self) -> bool {
        self.definition().traits.reads_the_past
    }

    /// Whether a control that is interpolated, not held, looks like it.
    pub(crate) fn is_imitated_by_hold(self) -> bool {
        self.definition().traits.imitated_by_hold
    }

    /// Whether one size can say what is excluded.
    pub(crate) fn has_single_size(self) -> bool {
        !self.definition().traits.has_no_single_size
    }

    /// Whether its size is a limit: the smaller, the more it does.
    pub fn size_is_a_limit(self) -> bool {
        self.definition().traits.is_a_limit
    }

    /// Whether a power study takes one place of each equation for all.
    pub(crate) fn has_many_places(self, variables: &[String]) -> bool {
        self.definition().traits.has_many_places && !variables.is_empty()
    }

    /// The fitted model with this effect in the equation of `state` as a reader should have it.
    pub(crate) fn tell(self, model: &mut Model, state: usize) {
        (self.definition().reported)(model, state);
    }

    /// The form with the names of the variables in it.
    pub(crate) fn form_of(self, variables: &[String]) -> String {
        let Definition { form, symbols, .. } = self.definition();
        // All at once: a variable may be called like a symbol.
        let place = |symbol: &str| symbols.iter().position(|s| *s == symbol);
        let is_difference = is_of_a_difference(variables);
        let name =
            |symbol: &str| place(symbol).filter(|place| !is_difference || *place == 0).and_then(|p| variables.get(p));
        let named: Vec<(&str, Expression)> =
            symbols.iter().filter_map(|s| Some((*s, Expression::variable(name(s)?.clone())))).collect();
        match written(form, &named) {
            Ok(expression) => expression.to_string(),
            Err(_) if is_difference => {
                format!("{}, z: the difference that {} multiplies", with_words(form, name), variables[0])
            }
            Err(_) => with_words(form, name),
        }
    }
}

/// The experiment that distinguishes two effects, by their ids, where the given logs cannot.
pub(crate) fn separating_experiment(one: &str, other: &str) -> &'static str {
    if one == Effect::ParameterError.id() && other == one {
        return experiment::ONE_CHANGED;
    }
    let known = Effect::from_id(one).zip(Effect::from_id(other));
    let found = known.and_then(|(one, other)| one.twins().into_iter().find(|(twin, _)| *twin == other));
    found.map_or(experiment::ANOTHER_RUN, |(_, experiment)| experiment)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_read_back() {
        for &effect in Effect::ALL {
            assert_eq!(Effect::from_id(effect.id()), Some(effect));
        }
        assert_eq!(Effect::from_id("nothing"), None);
    }

    #[test]
    fn twins_have_an_experiment_that_parts_them() {
        assert!(separating_experiment("input_lag", "input_delay").contains("chirp"));
        assert_eq!(
            separating_experiment("backlash", "input_dead_zone"),
            separating_experiment("input_dead_zone", "backlash")
        );
        assert_eq!(separating_experiment("backlash", "tyre_slip"), experiment::ANOTHER_RUN);
        assert_eq!(separating_experiment("parameter_error", "parameter_error"), experiment::ONE_CHANGED);
    }

    #[test]
    fn a_form_names_the_variables_and_leaves_its_own_symbols_alone() {
        let wrong = Effect::ParameterError.form_of(&["m".to_string()]);
        assert_eq!(wrong, Effect::ParameterError.form());
        let slip = Effect::Slip.form_of(&["C", "v", "w"].map(String::from));
        assert_eq!(
            slip,
            "C becomes C*sin(shape*asin(f))/(shape*e) with e = sqrt(q)*z/shape and f = e/(1 + abs(e)^n)^(1/n), z: the difference that C multiplies"
        );
        let form = |effect: Effect, variables: &[&str]| {
            effect.form_of(&variables.iter().map(ToString::to_string).collect::<Vec<_>>())
        };
        assert_eq!(form(Effect::InputSaturation, &["motor"]), "motor becomes clamp(motor, low, high)");
        assert_eq!(form(Effect::InputLag, &["u_1"]), "u_1 becomes a state that follows u_1 with time constant tau");
        assert_eq!(form(Effect::ProductCoupling, &["w", "z"]), "c*w*z");
        assert!(form(Effect::StribeckFriction, &["v"]).contains("(v/w)^2"));
    }

    #[test]
    fn a_report_lists_what_a_term_saturates_with_and_the_parameter_that_warms_up() {
        let names = |all: &[&str]| all.iter().map(ToString::to_string).collect::<Vec<_>>();
        assert_eq!(Effect::SaturatingRate.stated(&names(&["mu", "S"])), ["S"]);
        assert_eq!(Effect::Slip.stated(&names(&["C", "v", "w"])), ["v", "w"]);
        assert_eq!(Effect::Thermal.stated(&names(&["R", "u"])), ["R"]);
        assert_eq!(Effect::MotorLimit.stated(&names(&["u", "w"])), ["u", "w"]);
        assert_eq!(Effect::ParameterError.stated(&names(&["m"])), ["m"]);
        assert!(Effect::Bias.stated(&[]).is_empty());
    }
}
