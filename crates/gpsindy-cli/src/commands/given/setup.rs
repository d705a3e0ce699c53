//! What the file of a MuJoCo model or an FMU does not say: options of every command that steps one.

use crate::engine::{Base, Driver, Force, Lock, Setup};
use crate::failure::{Failure, Outcome};
use clap::{Args, ValueEnum};
use gpsindy_core::diagnose::{Diagnose, Part, PartKind};
use gpsindy_files::hint;

/// Around a MuJoCo model or an FMU.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "MuJoCo models")]
pub(crate) struct SetupOptions {
    /// PD loop of the driver around a `<motor>`, whose column is then the wanted position: gains and the delay of the command in s, such as
    /// hip=40,1,0.01; `*` stands for any characters. A `?` after a number marks a guess that the logs correct: '*=40?,1?'
    #[arg(long, value_name = "ACTUATOR=KP,KD[,DELAY]", value_parser = driver)]
    driver: Vec<Driver>,
    /// How a free base moves
    #[arg(long, value_enum, value_name = "HOW")]
    base: Option<HowBase>,
    /// Joints that do not move in these logs, so that neither they nor their actuators need a column; held where the file places them, or at a
    /// position in rad or m, such as elbow=0.5; `*` stands for any characters
    #[arg(long, value_name = "JOINT[=POSITION]", value_delimiter = ',', value_parser = lock)]
    lock: Vec<Lock>,
    /// Input of an FMU that no log has, as a place where a force may act: the state whose rate it changes and, if there is one, the state
    /// whose time derivative that is, such as torque=w,theta
    #[arg(long, value_name = "INPUT=RATE[,POSITION]", value_parser = force, help_heading = "FMUs")]
    force_input: Vec<Force>,
}

/// Which parts of a MuJoCo model are suspects.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "MuJoCo models")]
pub(crate) struct PartOptions {
    /// Test only effects in these joints, with the actuators that drive them and the mass of their own bodies
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    joint: Vec<String>,
    /// Test only effects of these actuators: command, gains and delay
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    actuator: Vec<String>,
}

impl PartOptions {
    /// The settings with the parts of a simulator, and of these the ones that were named.
    pub(crate) fn among(&self, parts: Vec<Part>, settings: Diagnose) -> Outcome<Diagnose> {
        let named = [(PartKind::Joint, "--joint", &self.joint), (PartKind::Actuator, "--actuator", &self.actuator)];
        let mut only = Vec::new();
        for (kind, option, names) in named {
            if !names.is_empty() && parts.is_empty() {
                return Err(Failure::input(format!(
                    "{option}: this simulator does not name its joints and actuators, as a MuJoCo model does; remove the option"
                )));
            }
            for name in names {
                let part = Part::find(&parts, kind, name).map_err(|_| {
                    let known = parts.iter().filter(|part| part.kind == kind).map(|part| part.name.as_str());
                    let kind = kind.as_str();
                    Failure::input(format!("{option}: the model has no {kind} `{name}`{}", hint(name, known)))
                });
                only.push(part?.clone());
            }
        }
        Ok(Diagnose { parts, only, ..settings })
    }
}

/// How a free base moves.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum HowBase {
    /// It is on a stand, as the file places it
    Fixed,
    /// As logged: orientation base_qw, base_qx, base_qy, base_qz, gyro base_wx, base_wy, base_wz and its derivative base_dwx, base_dwy, base_dwz
    Imu,
    /// As logged, with position base_x, velocity base_vx and acceleration base_ax, and so on for y and z, besides
    Pose,
}

impl SetupOptions {
    pub(crate) fn setup(&self) -> Setup {
        let base = self.base.map(|how| match how {
            HowBase::Fixed => Base::Fixed,
            HowBase::Imu => Base::Imu,
            HowBase::Pose => Base::Pose,
        });
        Setup { drivers: self.driver.clone(), base, locks: self.lock.clone(), forces: self.force_input.clone() }
    }
}

/// `hip=40,1,0.01?`.
fn driver(text: &str) -> Result<Driver, String> {
    let expected =
        || format!("expected ACTUATOR=KP,KD or ACTUATOR=KP,KD,DELAY, such as hip=40,1 or '*=40?,1?', found {text}");
    let (actuator, numbers) = text.rsplit_once('=').filter(|(name, _)| !name.is_empty()).ok_or_else(expected)?;
    let (mut values, mut guessed) = ([0.0; 3], [false; 3]);
    let numbers: Vec<&str> = numbers.split(',').map(str::trim).collect();
    if !(2..=3).contains(&numbers.len()) {
        return Err(expected());
    }
    for (place, number) in numbers.into_iter().enumerate() {
        guessed[place] = number.ends_with('?');
        let value: f64 = number.trim_end_matches('?').parse().map_err(|_| expected())?;
        if !(value.is_finite() && value >= 0.0) {
            return Err(format!("gains and delay must be finite and at least 0, found {number}"));
        }
        values[place] = value;
    }
    Ok(Driver { actuator: actuator.into(), values, guessed })
}

/// `elbow` or `elbow=0.5`.
fn lock(text: &str) -> Result<Lock, String> {
    let expected = || format!("expected JOINT or JOINT=POSITION, such as elbow or elbow=0.5, found {text}");
    let (joint, position) = match text.rsplit_once('=') {
        None => (text, None),
        Some((joint, position)) => (joint, Some(position.trim().parse::<f64>().map_err(|_| expected())?)),
    };
    if joint.trim().is_empty() || position.is_some_and(|position| !position.is_finite()) {
        return Err(expected());
    }
    Ok(Lock { joint: joint.trim().into(), position })
}

/// `torque=w,theta`.
fn force(text: &str) -> Result<Force, String> {
    let expected = || format!("expected INPUT=RATE or INPUT=RATE,POSITION, such as torque=w,theta, found {text}");
    let (input, states) = text.rsplit_once('=').ok_or_else(expected)?;
    let mut names = [input].into_iter().chain(states.split(',')).map(|name| name.trim().to_string());
    match (names.next(), names.next(), names.next(), names.next()) {
        (Some(input), Some(rate), position, None)
            if !input.is_empty() && !rate.is_empty() && position.as_deref() != Some("") =>
        {
            Ok(Force { input, rate, position })
        }
        _ => Err(expected()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_is_an_input_with_what_it_moves() {
        let wanted = |position: Option<&str>| Force {
            input: "f".into(),
            rate: "w".into(),
            position: position.map(str::to_string),
        };
        assert_eq!(force("f=w"), Ok(wanted(None)));
        assert_eq!(force("f = w, th"), Ok(wanted(Some("th"))));
        for wrong in ["f", "f=", "=w", "f=w,", "f=w,th,x"] {
            assert!(force(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_lock_is_a_joint_with_a_position_or_without() {
        assert_eq!(lock("elbow"), Ok(Lock { joint: "elbow".into(), position: None }));
        assert_eq!(lock("wrist_* = -0.5"), Ok(Lock { joint: "wrist_*".into(), position: Some(-0.5) }));
        for wrong in ["", "=1", "elbow=", "elbow=x", "elbow=inf"] {
            assert!(lock(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_driver_is_read_with_its_guesses() {
        let found = driver("*_hip=40?,1,0.01?");
        let wanted = Driver { actuator: "*_hip".into(), values: [40.0, 1.0, 0.01], guessed: [true, false, true] };
        assert_eq!(found, Ok(wanted));
        assert_eq!(driver("hip=40,1").map(|d| (d.values, d.guessed)), Ok(([40.0, 1.0, 0.0], [false; 3])));
        for wrong in ["hip", "hip=40", "=40,1", "hip=40,x", "hip=40,1,0,0", "hip=-1,1", "hip=inf,1"] {
            assert!(driver(wrong).is_err(), "{wrong}");
        }
    }
}
