//! Hypotheses: an effect of the catalogue at a place in a model, written into the model's equations.

pub(crate) use crate::diagnose::catalogue::applied::{Added, Applied, Combine, Role, Start};
use crate::diagnose::catalogue::custom::CustomEffect;
use crate::diagnose::catalogue::excited::Scene;
use crate::diagnose::catalogue::list::Effect;
use crate::diagnose::catalogue::place::{Family, Place};
use crate::diagnose::catalogue::rival::Rival;
use crate::diagnose::catalogue::sense::Sense;
use crate::diagnose::catalogue::sense::slipping::is_of_a_difference;
use crate::diagnose::catalogue::site::Site;
use crate::diagnose::report::FUNCTION;
use crate::model::{Model, unit};
use std::sync::Arc;

/// What acts: an effect of the catalogue, one of the user's own, or a function that nobody has a name for.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind {
    Catalogue(Effect),
    Custom(Box<CustomEffect>),
    Nameless(Arc<Rival>),
}

/// An effect at a place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Hypothesis {
    pub(crate) kind: Kind,
    /// The state in whose equation (or column) it acts.
    pub(crate) state: usize,
    /// The variables, controls or parameters that it depends on.
    pub(crate) variables: Vec<String>,
    /// The port or control at which it acts; the equation of its state where absent.
    pub(crate) site: Option<Arc<Site>>,
}

impl Hypothesis {
    pub(crate) fn catalogue(effect: Effect, state: usize, variables: &[&str]) -> Self {
        let variables = variables.iter().map(|v| (*v).to_string()).collect();
        Self { kind: Kind::Catalogue(effect), state, variables, site: None }
    }

    /// A function without a name, in the place of an effect.
    pub(crate) fn nameless(rival: &Rival) -> Self {
        let (state, variables) = (rival.state, rival.variables.clone());
        Self { kind: Kind::Nameless(Arc::new(rival.clone())), state, variables, site: None }
    }

    pub(crate) fn id(&self) -> &str {
        match &self.kind {
            Kind::Catalogue(effect) => effect.id(),
            Kind::Custom(custom) => &custom.id,
            Kind::Nameless(_) => FUNCTION,
        }
    }

    pub(crate) fn family(&self) -> Family {
        match &self.kind {
            Kind::Catalogue(effect) => effect.family(),
            Kind::Custom(_) | Kind::Nameless(_) => Family::Custom,
        }
    }

    /// The effect of the catalogue; `None` for one of the user's own, and for a function without a name.
    pub(crate) fn effect(&self) -> Option<Effect> {
        match &self.kind {
            Kind::Catalogue(effect) => Some(*effect),
            Kind::Custom(_) | Kind::Nameless(_) => None,
        }
    }

    /// Whether it is a function without a name.
    pub(crate) fn is_nameless(&self) -> bool {
        matches!(self.kind, Kind::Nameless(_))
    }

    /// Whether it is this effect.
    pub(crate) fn is(&self, effect: Effect) -> bool {
        self.effect() == Some(effect)
    }

    /// The parameter whose value it sets free.
    pub(crate) fn frees(&self) -> Option<&str> {
        if self.is(Effect::ParameterError) { self.variables.first().map(String::as_str) } else { None }
    }

    /// Whether it reads a state before the log begins.
    pub(crate) fn reads_the_past(&self) -> bool {
        self.effect().is_some_and(Effect::reads_the_past)
    }

    /// Whether a control that is interpolated, not held, looks like it.
    pub(crate) fn is_imitated_by_hold(&self) -> bool {
        self.effect().is_some_and(Effect::is_imitated_by_hold)
    }

    /// Whether it is a suspect only where a setting names it.
    pub(crate) fn is_only_if_asked(&self) -> bool {
        self.effect().is_some_and(Effect::is_only_if_asked) && !self.is_of_a_difference()
    }

    /// Whether it depends on the difference that its parameter multiplies: of such there are few places.
    pub(crate) fn is_of_a_difference(&self) -> bool {
        is_of_a_difference(&self.variables) && self.effect().is_some_and(|effect| effect.acts_at(Place::Contact))
    }

    /// Whether it waits until an effect that imitates it leads.
    pub(crate) fn waits(&self) -> bool {
        self.effect().is_some_and(|effect| !effect.stands_behind().is_empty()) && !self.is_of_a_difference()
    }

    /// Whether it is found from an effect that imitates it and that it contains: to a screening the two are one.
    pub(crate) fn begins_as_imitator(&self) -> bool {
        let begins =
            |effect: Effect| effect.stands_behind().iter().any(|imitator| effect.contains().contains(imitator));
        self.effect().is_some_and(begins)
    }

    /// Whether it may be the truth where `other` leads: an effect that imitates it, in the same equation and at the same parameter where
    /// that is a wrong one.
    pub(crate) fn stands_behind(&self, other: &Self) -> bool {
        let imitators = self.effect().map_or(&[][..], Effect::stands_behind);
        let is_there = other.frees().is_none_or(|name| self.variables.first().is_some_and(|own| own == name));
        other.effect().is_some_and(|effect| imitators.contains(&effect)) && self.state == other.state && is_there
    }

    /// Whether it is what makes a place unlike others.
    pub(crate) fn marks_a_place(&self) -> bool {
        self.effect().is_some_and(Effect::marks_a_place)
    }

    /// Whether it is the same effect in another place.
    pub(crate) fn is_elsewhere(&self, other: &Self) -> bool {
        self.effect().is_some() && self.effect() == other.effect() && self != other
    }

    /// How many states it adds to a model.
    pub(crate) fn added_states(&self) -> usize {
        self.effect().map_or(0, Effect::added_states)
    }

    /// Whether one size can say what is excluded.
    pub(crate) fn has_single_size(&self) -> bool {
        self.effect().is_none_or(Effect::has_single_size)
    }

    /// Whether a power study takes one place of each equation for all.
    pub(crate) fn has_many_places(&self) -> bool {
        self.effect().is_some_and(|e| e.has_many_places(&self.variables))
    }

    /// What must hold at its place and does not.
    pub(crate) fn broken_sense(&self, model: &Model, scene: &Scene) -> Option<Sense> {
        self.effect()?.definition().sense.iter().copied().find(|s| !s.holds(self.state, &self.variables, model, scene))
    }

    /// What it depends on, as a report lists it.
    pub(crate) fn stated(&self) -> &[String] {
        self.effect().map_or(&self.variables, |effect| effect.stated(&self.variables))
    }

    /// Its form with the names of the variables in it.
    pub(crate) fn form(&self) -> String {
        match &self.kind {
            Kind::Catalogue(effect) => effect.form_of(&self.variables),
            Kind::Custom(custom) => custom.form.to_string(),
            Kind::Nameless(rival) => format!("f({})", rival.variables.join(", ")),
        }
    }

    /// The fitted model with it as a reader should have it.
    pub(crate) fn tell(&self, model: &mut Model) {
        if let Some(effect) = self.effect() {
            effect.tell(model, self.state);
        }
    }

    /// The same effect at a port or control; `None` where the simulator's own parameter stands for it and is a suspect itself.
    pub(crate) fn at(&self, site: &Arc<Site>, model: &Model) -> Option<Self> {
        if self.effect().and_then(|effect| site.carrier(effect, model)).is_some_and(|p| p.value != 0.0) {
            return None;
        }
        // What acts at the other end of a spring has no force at this one.
        if self.is(Effect::ElasticJoint) && self.variables.iter().any(|z| *z != model.states[self.state].name) {
            return None;
        }
        let mut moved = Self { site: Some(site.clone()), ..self.clone() };
        // The position that a port names, in the place of the one whose rate its motion is.
        let integral = model.integral_of(self.state).map(|i| &model.states[i].name);
        if let (Some(integral), Some(position)) = (integral, &site.position) {
            moved.variables.iter_mut().filter(|v| *v == integral).for_each(|v| v.clone_from(position));
        }
        Some(moved)
    }

    /// The simulator's own parameter that stands for this effect at its site.
    pub(crate) fn carrier(&self, model: &Model) -> Option<String> {
        self.site.as_ref()?.carrier(self.effect()?, model).map(|p| p.name.clone())
    }

    /// Name of the port or control at which it acts.
    pub(crate) fn place(&self) -> Option<String> {
        self.site.as_ref().map(|site| site.name.clone())
    }

    /// Typical rate of its equation, or the force at its site that moves as much.
    pub(crate) fn typical_rate(&self, scene: &Scene) -> f64 {
        let rate = scene.rates[self.state.min(scene.rates.len() - 1)];
        self.site.as_ref().map_or(rate, |site| rate / site.gain)
    }

    /// Unit of that.
    pub(crate) fn unit_of_rate(&self, model: &Model) -> String {
        self.site.as_ref().map_or_else(|| model.states[self.state].rate_unit(), |site| site.unit.clone())
    }

    /// Unit of a factor before its variables: the unit of its rate by theirs to these powers, `(variable, power)`.
    pub(crate) fn unit_per(&self, model: &Model, powers: &[(usize, i32)]) -> String {
        let units: Vec<(String, i32)> =
            powers.iter().map(|&(index, power)| (self.unit_of(model, index), -power)).collect();
        let parts = std::iter::once((self.unit_of_rate(model), 1)).chain(units).collect::<Vec<_>>();
        unit::product(&parts.iter().map(|(unit, power)| (unit.as_str(), *power)).collect::<Vec<_>>())
    }

    /// Unit of one of its variables; empty where unknown.
    pub(crate) fn unit_of(&self, model: &Model, index: usize) -> String {
        let Some(name) = self.variables.get(index) else { return String::new() };
        let state = model.states.iter().find(|s| s.name == *name).map(|s| &s.unit);
        let control = || model.controls.iter().find(|c| c.name == *name).map(|c| &c.unit);
        state.or_else(control).cloned().unwrap_or_default()
    }

    /// The state whose rate it moves most.
    pub(crate) fn moves(&self) -> usize {
        self.site.as_ref().map_or(self.state, |site| site.moves)
    }
}
