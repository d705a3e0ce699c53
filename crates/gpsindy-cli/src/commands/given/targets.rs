//! Commands that look like wanted positions where the simulator takes a force: the loop of the motor's driver is in neither file.

use crate::screen::Screen;
use gpsindy_core::{Dataset, Model};

/// Share of a position's variance by which a command may differ from it and still be its target. A torque agrees with an angle
/// in offset and size by accident alone; a loop that lags by a tenth of a radian of a swing of one leaves a hundredth.
const FOLLOWED: f64 = 0.1;

/// Warns of commands of a simulator without a unit that a position follows, with what to do.
pub(crate) fn doubt_targets(data: &Dataset, model: &Model, screen: &Screen) {
    if !model.calls_simulator() {
        return;
    }
    for (command, position) in followed(data, model) {
        screen.warn(&format!(
            "`{position}` goes where `{command}` says, as a driver's loop makes it, and the simulator takes `{command}` as it is; if it is the wanted \
             position and the file has a <motor>, add the loop with --driver ACTUATOR=kp,kd (`?` behind a number marks a guess)"
        ));
    }
}

/// Commands without a unit, each with the measured position that follows it most closely.
fn followed<'a>(data: &Dataset, model: &'a Model) -> Vec<(&'a str, &'a str)> {
    let is_position = |unit: &str| matches!(unit, "rad" | "m");
    let positions = || model.states.iter().filter(|state| is_position(&state.unit));
    let bare = model.controls.iter().filter(|control| control.unit.is_empty());
    let closest = |control: &'a str| {
        let shares =
            positions().filter_map(|state| Some((difference(data, control, &state.name)?, state.name.as_str())));
        shares
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(share, _)| *share < FOLLOWED)
            .map(|(_, name)| (control, name))
    };
    bare.filter_map(|control| closest(&control.name)).collect()
}

/// Mean squared difference of two columns as a share of how much the second one moves; nothing where one is missing or does not move.
fn difference(data: &Dataset, command: &str, position: &str) -> Option<f64> {
    let [command, position] = [data.index_of(command).ok()?, data.index_of(position).ok()?];
    let pairs = data.runs().iter().flat_map(|run| run.column(command).iter().zip(run.column(position)));
    let pairs: Vec<(f64, f64)> = pairs.map(|(u, q)| (*u, *q)).filter(|(u, q)| (u - q).is_finite()).collect();
    let count = pairs.len() as f64;
    let mean = pairs.iter().map(|(_, q)| q).sum::<f64>() / count;
    let moved = pairs.iter().map(|(_, q)| (q - mean).powi(2)).sum::<f64>();
    let apart = pairs.iter().map(|(u, q)| (u - q).powi(2)).sum::<f64>();
    (moved > 0.0).then(|| apart / moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gpsindy_core::{Channel, Control, Expression, Run, State};

    #[test]
    fn a_command_that_a_position_follows_is_a_target_and_a_torque_is_none() {
        let state = |name: &str| State { unit: "rad".into(), ..State::new(name, Expression::Pi) };
        let mut model = Model {
            states: vec![state("hip"), state("knee")],
            controls: vec![Control::new("hip_motor"), Control::new("knee_motor")],
            ..Model::default()
        };
        model.call_simulator(&[]);
        let column = |t: f64, c: usize| match c {
            0 => t.sin(),
            1 => 0.5 + 0.3 * (2.0 * t).cos(),
            2 => (t + 0.1).sin(),
            _ => 4.0 * (2.0 * t).cos(),
        };
        let time: Vec<f64> = (0..200).map(|i| 0.05 * f64::from(i)).collect();
        let values = faer::Mat::from_fn(200, 4, |i, c| column(time[i], c));
        let channels = ["hip", "knee", "hip_motor", "knee_motor"].map(Channel::new).into();
        let data = Dataset::new(channels, vec![Run { name: "log.csv".into(), time, values }]).unwrap();
        assert_eq!(followed(&data, &model), [("hip_motor", "hip")]);
    }
}
