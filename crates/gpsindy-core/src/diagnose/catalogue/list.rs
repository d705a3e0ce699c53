//! The list of effects. A new one is a line here, and a file of its id in `effects/` (with the `mod` line that Rust asks for).

/// Hands the list, `Variant id` by `Variant id`, to another macro.
macro_rules! for_every_effect {
    ($make:ident) => {
        $make! {
            ParameterError parameter_error,
            Bias bias,
            ViscousFriction viscous_friction,
            CoulombFriction coulomb_friction,
            StribeckFriction stribeck_friction,
            QuadraticDrag quadratic_drag,
            LinearStiffness linear_stiffness,
            CubicStiffness cubic_stiffness,
            GravityLoad gravity_load,
            Coupling coupling,
            ProductCoupling product_coupling,
            InputGain input_gain,
            InputBias input_bias,
            InputSaturation input_saturation,
            InputDeadZone input_dead_zone,
            InputDelay input_delay,
            InputLag input_lag,
            Backlash backlash,
            Cogging cogging,
            PeriodicDisturbance periodic_disturbance,
            StepDisturbance step_disturbance,
            Drift drift,
            SensorBias sensor_bias,
            SensorScale sensor_scale,
            SensorDelay sensor_delay,
            Inertia inertia,
            MotorLimit motor_limit,
            Supply supply,
            InputRateLimit input_rate_limit,
            InputHold input_hold,
            AsymmetricFriction asymmetric_friction,
            LoadFriction load_friction,
            Stiction stiction,
            Hysteresis hysteresis,
            GearPlay gear_play,
            ElasticJoint elastic_joint,
            EndStop end_stop,
            SaturatingRate saturating_rate,
            Thermal thermal,
            Slip slip,
            ProcessNoise process_noise,
            SensorFilter sensor_filter,
            SensorHold sensor_hold,
            Clock clock,
        }
    };
}
pub(crate) use for_every_effect;

macro_rules! make_enum {
    ($($variant:ident $id:ident),+ $(,)?) => {
        /// An effect of the catalogue.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[non_exhaustive]
        pub enum Effect { $(#[doc = concat!("`", stringify!($id), "`.")] $variant),+ }

        impl Effect {
            /// Every effect of the catalogue, in its order.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The id in reports and options.
            pub fn id(self) -> &'static str {
                match self { $(Self::$variant => stringify!($id)),+ }
            }
        }
    };
}

for_every_effect!(make_enum);

impl Effect {
    /// The effect with this id.
    pub fn from_id(id: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|e| e.id() == id)
    }
}
