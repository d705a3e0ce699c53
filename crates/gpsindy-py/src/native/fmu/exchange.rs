//! Steps of model exchange: Runge-Kutta of order 4, from event to event where the FMU has indicators of them.

use super::failure::Failure;
use super::unit::Unit;

/// Part of a step to which an event is located; the flow between two events is smooth, so halving it is enough.
const LOCATED: f64 = 1e-9;

/// Events in one step, and updates at one event, above which they are taken to accumulate, as the bounces of a ball at rest do.
const MOST_EVENTS: usize = 100;

/// What a step is computed in.
pub(super) struct Exchange {
    /// Where the derivatives are asked for.
    stage: Vec<f64>,
    /// Derivatives of the four stages.
    rates: [Vec<f64>; 4],
    indicators: Vec<f64>,
    /// Whether an indicator is above 0, at the beginning of a flow and at a state of it.
    before: Vec<bool>,
    signs: Vec<bool>,
    /// The state at the end of a flow.
    end: Vec<f64>,
}

impl Exchange {
    /// Initialises the unit, which has so many event indicators.
    pub(super) fn begin(unit: &mut Unit, indicators: usize) -> Result<Self, Failure> {
        initialize(unit)?;
        let states = || vec![0.0; unit.references.states.len()];
        Ok(Self {
            stage: states(),
            rates: [states(), states(), states(), states()],
            indicators: vec![0.0; indicators],
            before: vec![false; indicators],
            signs: vec![false; indicators],
            end: states(),
        })
    }

    /// Back to the start, with the present parameters.
    pub(super) fn reset(unit: &mut Unit) -> Result<(), Failure> {
        unit.component.reset()?;
        initialize(unit)
    }

    /// Takes the states over `dt` s, the inputs held.
    pub(super) fn step(&mut self, unit: &mut Unit, x: &mut [f64], inputs: &[f64], dt: f64) -> Result<(), Failure> {
        if !self.indicators.is_empty() {
            return self.through_events(unit, x, inputs, dt);
        }
        unit.component.set_time(0.0)?;
        unit.component.set(&unit.references.inputs, inputs)?;
        self.flow(unit, x, dt)?;
        x.copy_from_slice(&self.end);
        Ok(())
    }

    /// From event to event.
    ///
    /// What an FMU keeps in addition to its states, such as the side of a contact, follows from the state at the step's beginning.
    fn through_events(&mut self, unit: &mut Unit, x: &mut [f64], inputs: &[f64], dt: f64) -> Result<(), Failure> {
        Self::reset(unit)?;
        unit.component.set_time(0.0)?;
        unit.component.set(&unit.references.inputs, inputs)?;
        act(unit, x)?;
        let mut left = dt;
        for _ in 0..MOST_EVENTS {
            self.look(unit, x)?;
            std::mem::swap(&mut self.before, &mut self.signs);
            if self.is_before_event(unit, x, left)? {
                x.copy_from_slice(&self.end);
                break;
            }
            // Behind the event, where its condition holds.
            let (mut low, mut high) = (0.0, 1.0);
            while high - low > LOCATED {
                let middle = 0.5 * (low + high);
                if self.is_before_event(unit, x, middle * left)? { low = middle } else { high = middle }
            }
            self.flow(unit, x, high * left)?;
            x.copy_from_slice(&self.end);
            act(unit, x)?;
            left *= 1.0 - high;
        }
        Ok(())
    }

    /// Flows for `dt` s and says whether no indicator changed its sign.
    fn is_before_event(&mut self, unit: &mut Unit, x: &[f64], dt: f64) -> Result<bool, Failure> {
        self.flow(unit, x, dt)?;
        let end = std::mem::take(&mut self.end);
        let outcome = self.look(unit, &end);
        self.end = end;
        outcome?;
        Ok(self.signs == self.before)
    }

    /// Signs of the event indicators at a state.
    fn look(&mut self, unit: &mut Unit, x: &[f64]) -> Result<(), Failure> {
        unit.component.set_continuous_states(x)?;
        unit.component.get_event_indicators(&mut self.indicators)?;
        self.signs.iter_mut().zip(&self.indicators).for_each(|(sign, z)| *sign = *z > 0.0);
        Ok(())
    }

    /// A step of Runge-Kutta of order 4 from `x` to the end of the flow.
    fn flow(&mut self, unit: &mut Unit, x: &[f64], dt: f64) -> Result<(), Failure> {
        let Self { stage, rates, end, .. } = self;
        stage.copy_from_slice(x);
        for (i, part) in [0.5, 0.5, 1.0, 0.0].into_iter().enumerate() {
            unit.component.set_continuous_states(stage)?;
            unit.component.get_derivatives(&mut rates[i])?;
            let length = part * dt;
            stage.iter_mut().zip(x).zip(&rates[i]).for_each(|((stage, x), rate)| *stage = x + length * rate);
        }
        let [first, second, third, fourth] = rates;
        let sixth = dt / 6.0;
        for j in 0..x.len() {
            end[j] = x[j] + sixth * (first[j] + 2.0 * second[j] + 2.0 * third[j] + fourth[j]);
        }
        Ok(())
    }
}

/// From instantiated or reset to continuous time.
fn initialize(unit: &mut Unit) -> Result<(), Failure> {
    unit.initialize(None)?;
    settle(unit)?;
    unit.component.enter_continuous_time_mode()
}

/// Makes of a state what an event makes of it, where there is one.
fn act(unit: &mut Unit, x: &mut [f64]) -> Result<(), Failure> {
    unit.component.set_continuous_states(x)?;
    unit.component.enter_event_mode()?;
    settle(unit)?;
    unit.component.enter_continuous_time_mode()?;
    unit.component.get_continuous_states(x)
}

/// Updates the discrete states until that is not needed.
fn settle(unit: &mut Unit) -> Result<(), Failure> {
    for _ in 0..MOST_EVENTS {
        let event = unit.component.update_discrete_states()?;
        if event.timed {
            return Err(Failure::TimeEvent);
        }
        if !event.again {
            break;
        }
    }
    Ok(())
}
