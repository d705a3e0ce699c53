//! What the diagnosis knows of every effect of the list: one file each.

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
mod input_hold;
mod input_lag;
mod input_rate_limit;
mod input_saturation;
mod linear_stiffness;
mod load_friction;
mod motor_limit;
mod parameter_error;
mod periodic_disturbance;
mod process_noise;
mod product_coupling;
mod quadratic_drag;
mod saturating_rate;
mod sensor_bias;
mod sensor_delay;
mod sensor_filter;
mod sensor_hold;
mod sensor_scale;
mod slip;
mod step_disturbance;
mod stiction;
mod stribeck_friction;
mod supply;
mod thermal;
mod viscous_friction;

use crate::diagnose::catalogue::definition::Definition;
use crate::diagnose::catalogue::list::{Effect, for_every_effect};

macro_rules! look_up {
    ($($variant:ident $id:ident),+ $(,)?) => {
        impl Effect {
            pub(crate) fn definition(self) -> &'static Definition {
                match self { $(Self::$variant => &$id::DEFINITION),+ }
            }
        }
    };
}

for_every_effect!(look_up);
