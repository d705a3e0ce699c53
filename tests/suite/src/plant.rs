//! A plant: what the nominal model says in text, and the same physics in code of its own.

/// Derivative of the states: parameters, states, controls, time, result.
pub type Flow = fn(&[f64], &[f64], &[f64], f64, &mut [f64]);

/// A state of the plant.
#[derive(Debug, Clone)]
pub struct State {
    /// Name in the model.
    pub name: String,
    /// Unit, may be empty.
    pub unit: String,
    /// Right side in the contract's expression language.
    pub equation: String,
    /// Initial value: centre and half width of its uniform draw.
    pub start: (f64, f64),
}

/// A control of the plant.
#[derive(Debug, Clone)]
pub struct Control {
    /// Name in the model.
    pub name: String,
    /// Unit, may be empty.
    pub unit: String,
    /// Value about which an open-loop excitation moves.
    pub centre: f64,
    /// Largest excursion of an open-loop excitation; in a closed loop the limit of the actuator.
    pub amplitude: f64,
    /// May the command turn its sign about the centre? (a pump and a heater may not)
    pub one_way: bool,
}

/// A parameter of the nominal model.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Name in the model.
    pub name: String,
    /// Unit, may be empty.
    pub unit: String,
    /// Nominal value.
    pub value: f64,
    /// Relative belief, absent: taken as exact.
    pub tolerance: Option<f64>,
    /// Is it a plain constant such as gravity that nobody doubts?
    pub certain: bool,
}

/// What kind of equation a row is: it decides which effects make physical sense there.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(missing_docs)]
pub enum Row {
    /// Derivative of a position: exact, no effect acts there.
    Kinematic,
    /// Balance of forces of the velocity that is this state; the index of its position.
    Force { position: Option<usize>, angle: bool },
    /// A rate that a control commands: no force of its own state acts there.
    Rate,
    /// First-order balance: a level, a temperature, a concentration, a current.
    Balance,
}

/// A feedback law: `u = centre + integral gain * sum(e) + K (reference - measured)`, within the actuator's limits.
#[derive(Debug, Clone)]
pub struct Feedback {
    /// Gains: one row a control, one column a state (all states are logged then).
    pub gain: Vec<Vec<f64>>,
    /// States whose reference moves: index and amplitude.
    pub reference: Vec<(usize, f64)>,
    /// Is the plant unstable without it?
    pub unstable: bool,
}

/// A plant with drawn parameters.
#[derive(Debug, Clone)]
pub struct Plant {
    /// Name of the family.
    pub name: &'static str,
    /// States, in the order of the flow.
    pub states: Vec<State>,
    /// Controls, in the order of the flow.
    pub controls: Vec<Control>,
    /// Parameters, in the order of the flow.
    pub parameters: Vec<Parameter>,
    /// Kind of each row.
    pub rows: Vec<Row>,
    /// The physics.
    pub flow: Flow,
    /// Which states are logged.
    pub logged: Vec<usize>,
    /// Samples a second.
    pub rate: f64,
    /// Seconds a run.
    pub duration: f64,
    /// Band of an excitation in Hz.
    pub band: (f64, f64),
    /// Pairs of states that another axis may couple: (row, other state).
    pub couplings: Vec<(usize, usize)>,
    /// Feedback, where the plant is run in a closed loop.
    pub feedback: Option<Feedback>,
    /// States that the physics keeps above zero.
    pub positive: bool,
}

impl Plant {
    /// An empty plant of this family.
    pub fn new(name: &'static str, flow: Flow) -> Self {
        Self {
            name,
            states: Vec::new(),
            controls: Vec::new(),
            parameters: Vec::new(),
            rows: Vec::new(),
            flow,
            logged: Vec::new(),
            rate: 50.0,
            duration: 15.0,
            band: (0.1, 1.0),
            couplings: Vec::new(),
            feedback: None,
            positive: false,
        }
    }

    /// Adds a kinematic state: the derivative of a position.
    pub fn position(self, name: &str, unit: &str, equation: &str, start: f64) -> Self {
        self.row(name, unit, equation, (0.0, start), Row::Kinematic)
    }

    /// Adds a velocity with its balance of forces.
    pub fn velocity(self, name: &str, unit: &str, equation: &str, start: f64, position: Option<usize>) -> Self {
        self.row(name, unit, equation, (0.0, start), Row::Force { position, angle: false })
    }

    /// Adds an angular velocity whose position is an angle.
    pub fn angular(self, name: &str, equation: &str, start: f64, position: usize) -> Self {
        self.row(name, "rad/s", equation, (0.0, start), Row::Force { position: Some(position), angle: true })
    }

    /// Adds a first-order balance that starts within `start.0 ± start.1`.
    pub fn balance(self, name: &str, unit: &str, equation: &str, start: (f64, f64)) -> Self {
        self.row(name, unit, equation, start, Row::Balance)
    }

    /// Adds a state.
    pub fn row(mut self, name: &str, unit: &str, equation: &str, start: (f64, f64), row: Row) -> Self {
        self.states.push(State { name: name.into(), unit: unit.into(), equation: equation.into(), start });
        self.rows.push(row);
        self.logged.push(self.states.len() - 1);
        self
    }

    /// Adds a control that moves about zero.
    pub fn control(self, name: &str, unit: &str, amplitude: f64) -> Self {
        self.drive(name, unit, 0.0, amplitude, false)
    }

    /// Adds a control that moves about `centre`; `one_way` keeps it at zero or above.
    pub fn drive(mut self, name: &str, unit: &str, centre: f64, amplitude: f64, one_way: bool) -> Self {
        self.controls.push(Control { name: name.into(), unit: unit.into(), centre, amplitude, one_way });
        self
    }

    /// Adds a parameter.
    pub fn parameter(mut self, name: &str, unit: &str, value: f64) -> Self {
        self.parameters.push(Parameter {
            name: name.into(),
            unit: unit.into(),
            value,
            tolerance: None,
            certain: false,
        });
        self
    }

    /// Adds a constant that nobody doubts.
    pub fn constant(mut self, name: &str, unit: &str, value: f64) -> Self {
        self = self.parameter(name, unit, value);
        if let Some(last) = self.parameters.last_mut() {
            last.certain = true;
        }
        self
    }

    /// Says which states are logged.
    pub fn log(mut self, logged: &[usize]) -> Self {
        self.logged = logged.to_vec();
        self
    }

    /// Samples a second, seconds a run, band of the excitation in Hz.
    pub fn timing(mut self, rate: f64, duration: f64, band: (f64, f64)) -> Self {
        (self.rate, self.duration, self.band) = (rate, duration, band);
        self
    }

    /// Rows and the states of another axis that may reach into them.
    pub fn coupled(mut self, couplings: &[(usize, usize)]) -> Self {
        self.couplings = couplings.to_vec();
        self
    }

    /// Closes the loop.
    pub fn closed(mut self, gain: Vec<Vec<f64>>, reference: &[(usize, f64)], unstable: bool) -> Self {
        self.feedback = Some(Feedback { gain, reference: reference.to_vec(), unstable });
        self
    }

    /// The nominal parameter values.
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }
}
