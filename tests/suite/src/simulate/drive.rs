//! From the commands of a run to what its drives do.

use super::{Commands, Machine, Setup};
use crate::effect::{Act, Actuator};

impl Machine<'_> {
    pub(super) fn rate(&self, control: usize) -> Option<f64> {
        self.effects.iter().find_map(|e| match e.act {
            Act::Actuator { control: j, law: Actuator::RateLimit { c } } if j == control => Some(c),
            _ => None,
        })
    }

    /// The command at sample `k`.
    pub(super) fn command(&self, setup: &Setup, k: usize, reading: &[f64]) -> Vec<f64> {
        match &setup.commands {
            Commands::Open(rows) => rows[k].clone(),
            Commands::Closed { reference, noise, dither } => {
                let Some(feedback) = &self.plant.feedback else { return dither[k].clone() };
                let law = |(j, control): (usize, &crate::plant::Control)| {
                    let correction: f64 = (0..reading.len())
                        .map(|i| feedback.gain[j][i] * (reference[k][i] - reading[i] - noise[k][i]))
                        .sum();
                    let low = if control.one_way { 0.0 } else { control.centre - control.amplitude };
                    let u = control.centre + dither[k][j] + correction;
                    // Logged with six digits, and applied as it was logged.
                    crate::random::digits(u.clamp(low, control.centre + control.amplitude), 6)
                };
                self.plant.controls.iter().enumerate().map(law).collect()
            }
        }
    }

    /// Value and slope of control `j` at the plant just after time `t`, within sample interval `k`.
    pub(super) fn applied(
        &self,
        setup: &Setup,
        log: &[Vec<f64>],
        k: usize,
        j: usize,
        t: f64,
        play: &mut f64,
    ) -> (f64, f64) {
        let times = &setup.times;
        let (mut value, mut slope) = (log[k][j], 0.0);
        if let (true, Commands::Open(rows)) = (setup.linear, &setup.commands)
            && let Some(next) = rows.get(k + 1)
        {
            slope = (next[j] - value) / (times[k + 1] - times[k]);
            value += slope * (t - times[k]);
        }
        for effect in self.effects {
            let Act::Actuator { control, law } = effect.act else { continue };
            if control != j {
                continue;
            }
            match law {
                Actuator::Delay { tau } => {
                    let seen = times[..=k].partition_point(|&s| s + tau <= t);
                    value = log[seen.saturating_sub(1)][j];
                }
                Actuator::Gain { c } => value *= 1.0 + c,
                Actuator::Bias { c } => value += c,
                Actuator::Saturation { c } => value = value.clamp(-c, c),
                Actuator::DeadZone { c } => value = value.signum() * (value.abs() - c).max(0.0),
                Actuator::Play { c } => {
                    *play = play.clamp(value - 0.5 * c, value + 0.5 * c);
                    value = *play;
                }
                Actuator::Lag { .. } | Actuator::RateLimit { .. } | Actuator::SpeedLimit { .. } => {}
            }
        }
        (value, slope)
    }
}
