//! The list of effects. A new one is a line here, and the file that the line names, in the folder of its family.

/// Hands the list, `Variant id "file"` by `Variant id "file"`, to another macro.
macro_rules! for_every_effect {
    ($make:ident) => {
        $make! {
            ParameterError parameter_error "parameter/parameter_error.rs",
            Bias bias "parameter/bias.rs",
            ViscousFriction viscous_friction "friction/viscous_friction.rs",
            CoulombFriction coulomb_friction "friction/coulomb_friction.rs",
            StribeckFriction stribeck_friction "friction/stribeck_friction.rs",
            QuadraticDrag quadratic_drag "friction/quadratic_drag.rs",
            LinearStiffness linear_stiffness "stiffness/linear_stiffness.rs",
            CubicStiffness cubic_stiffness "stiffness/cubic_stiffness.rs",
            GravityLoad gravity_load "stiffness/gravity_load.rs",
            Coupling coupling "coupling/coupling.rs",
            ProductCoupling product_coupling "coupling/product_coupling.rs",
            InputGain input_gain "input/input_gain.rs",
            InputBias input_bias "input/input_bias.rs",
            InputSaturation input_saturation "input/input_saturation.rs",
            InputDeadZone input_dead_zone "input/input_dead_zone.rs",
            InputDelay input_delay "input/input_delay.rs",
            InputLag input_lag "input/input_lag.rs",
            Backlash backlash "input/backlash.rs",
            Cogging cogging "stiffness/cogging.rs",
            PeriodicDisturbance periodic_disturbance "time/periodic_disturbance.rs",
            StepDisturbance step_disturbance "time/step_disturbance.rs",
            Drift drift "time/drift.rs",
            SensorBias sensor_bias "sensor/sensor_bias.rs",
            SensorScale sensor_scale "sensor/sensor_scale.rs",
            SensorDelay sensor_delay "sensor/sensor_delay.rs",
            Inertia inertia "parameter/inertia.rs",
            MotorLimit motor_limit "input/motor_limit.rs",
            Supply supply "input/supply.rs",
            InputRateLimit input_rate_limit "input/input_rate_limit.rs",
            InputHold input_hold "input/input_hold.rs",
            AsymmetricFriction asymmetric_friction "friction/asymmetric_friction.rs",
            LoadFriction load_friction "friction/load_friction.rs",
            Stiction stiction "friction/stiction.rs",
            Hysteresis hysteresis "input/hysteresis.rs",
            GearPlay gear_play "input/gear_play.rs",
            ElasticJoint elastic_joint "coupling/elastic_joint.rs",
            EndStop end_stop "stiffness/end_stop.rs",
            SaturatingRate saturating_rate "coupling/saturating_rate.rs",
            Thermal thermal "time/thermal.rs",
            Slip slip "coupling/slip.rs",
            ProcessNoise process_noise "time/process_noise.rs",
            SensorFilter sensor_filter "sensor/sensor_filter.rs",
            SensorCurve sensor_curve "sensor/sensor_curve.rs",
            SensorHold sensor_hold "sensor/sensor_hold.rs",
            Clock clock "sensor/clock.rs",
        }
    };
}
pub(crate) use for_every_effect;

macro_rules! make_enum {
    ($($variant:ident $id:ident $file:literal),+ $(,)?) => {
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
