//! Where an effect can act, and of which kind it is.

/// A group of effects of the same physical kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Family {
    /// A nominal parameter is wrong.
    Parameter,
    /// Functions of the state's own rate.
    Friction,
    /// Functions of a position.
    Stiffness,
    /// Products and other axes.
    Coupling,
    /// A static map of the control.
    InputStatic,
    /// A control that acts late.
    InputDynamic,
    /// A control that passes a play.
    Memory,
    /// Functions of time.
    Time,
    /// The sensor and not the plant.
    Sensor,
    /// An effect of the user's own.
    Custom,
}

impl Family {
    /// Its name in reports.
    pub fn id(self) -> &'static str {
        match self {
            Self::Parameter => "parameter",
            Self::Friction => "friction",
            Self::Stiffness => "stiffness",
            Self::Coupling => "coupling",
            Self::InputStatic => "input_static",
            Self::InputDynamic => "input_dynamic",
            Self::Memory => "memory",
            Self::Time => "time",
            Self::Sensor => "sensor",
            Self::Custom => "custom",
        }
    }
}

/// Where an effect can act, and on what it depends there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// In an equation, on nothing.
    Row,
    /// In an equation, on its own state.
    Own,
    /// In an equation, on the place whose rate its state is; on the state itself where that may be a place.
    Position,
    /// In an equation, on another axis' state or on a control that the equation lacks.
    Other,
    /// In an equation, on two variables.
    Pair,
    /// In an equation, on time.
    Time,
    /// Wherever a parameter appears.
    Parameter,
    /// Wherever a control appears.
    Control,
    /// What a column reads.
    Sensor,
    /// In an equation, on its own state and another force of it: a control or the place that it depends on.
    Load,
    /// In an equation, on a control or the position in it, which may act at the other end of a spring.
    OtherEnd,
    /// Wherever a control appears, on the state of the equation that it moves most.
    DriveAndSpeed,
    /// Wherever a control appears, on a control that no equation has: a column that was logged beside.
    Supply,
    /// Wherever a parameter appears, on a state that its terms hold.
    Rate,
    /// Wherever a parameter appears, on the difference of speeds that it multiplies.
    Contact,
    /// Wherever a parameter appears, on a control of the same equation or a state that its terms hold.
    Heated,
    /// The difference of two places of the model.
    Gap,
    /// In an equation, at random: no place for a search by rollouts.
    Random,
}

impl Place {
    /// The places within an equation, in the order in which they are tried.
    pub(crate) const IN_A_ROW: [Self; 8] =
        [Self::Row, Self::Own, Self::Position, Self::Other, Self::Pair, Self::Time, Self::Load, Self::OtherEnd];

    /// The places that are not of one equation, in the order in which they are tried.
    pub(crate) const ELSEWHERE: [Self; 6] =
        [Self::DriveAndSpeed, Self::Supply, Self::Rate, Self::Contact, Self::Heated, Self::Gap];

    /// The place in words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Row => "any dynamic equation",
            Self::Own => "a dynamic equation, as a function of its own state",
            Self::Position => "a dynamic equation, as a function of the position that belongs to it",
            Self::Other => {
                "a dynamic equation, as a function of another state or of a control that it does not contain"
            }
            Self::Pair => "a dynamic equation, as a function of two variables",
            Self::Time => "any dynamic equation, as a function of time",
            Self::Parameter => "every equation that contains a parameter",
            Self::Control => "every equation that contains a control",
            Self::Sensor => "a logged column",
            Self::Load => "a dynamic equation, as a function of its own state and of another force in it",
            Self::OtherEnd => "a dynamic equation, as a function of a control or the position in it",
            Self::DriveAndSpeed => {
                "every equation that contains a control, as a function of the speed that the control drives"
            }
            Self::Supply => {
                "every equation that contains a control, as a function of a logged control that no equation uses, or of a voltage or pressure that is in none of them but its own"
            }
            Self::Rate => "every equation that contains a parameter, as a function of a state in its terms",
            Self::Contact => {
                "every equation that contains a parameter, as a function of the difference of speeds that it multiplies"
            }
            Self::Heated => {
                "every equation that contains a parameter, as a function of a control of the same equation or of a state in its terms"
            }
            Self::Gap => {
                "every equation that contains the difference of two positions, or of a position and its command"
            }
            Self::Random => "any dynamic equation, at random",
        }
    }
}
