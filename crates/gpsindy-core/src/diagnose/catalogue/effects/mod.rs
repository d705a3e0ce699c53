//! The list of effects. A new one is a file beside this one and a line here (and the `mod` line that Rust asks for).

mod asymmetric_friction;
mod backlash;
mod bias;
mod clock;
mod cogging;
mod coulomb_friction;
mod coupling;
mod cubic_stiffness;
mod drift;
mod elastic_joint;
mod end_stop;
mod gear_play;
mod gravity_load;
mod hysteresis;
mod inertia;
mod input_bias;
mod input_dead_zone;
mod input_delay;
mod input_gain;
mod input_lag;
mod input_rate_limit;
mod input_saturation;
mod linear_stiffness;
mod load_friction;
mod motor_limit;
mod parameter_error;
mod periodic_disturbance;
mod product_coupling;
mod quadratic_drag;
mod saturating_rate;
mod sensor_bias;
mod sensor_delay;
mod sensor_filter;
mod sensor_scale;
mod slip;
mod step_disturbance;
mod stiction;
mod stribeck_friction;
mod supply;
mod thermal;
mod viscous_friction;

use crate::diagnose::catalogue::definition::Definition;

macro_rules! catalogue {
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

            pub(crate) fn definition(self) -> &'static Definition {
                match self { $(Self::$variant => &$id::DEFINITION),+ }
            }
        }
    };
}

catalogue! {
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
    SensorFilter sensor_filter,
    Clock clock,
}
