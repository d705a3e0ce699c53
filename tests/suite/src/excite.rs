//! Excitations of a run: what drives a control, or a reference, through time.

use crate::random::Draw;
use std::f64::consts::TAU;

/// A signal between about -1 and 1 with its derivative.
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub enum Signal {
    /// Sum of sines: amplitude, frequency in Hz, phase.
    Multisine(Vec<(f64, f64, f64)>),
    /// Levels held for their durations: end time and level.
    Steps(Vec<(f64, f64)>),
    /// Sweep from one frequency to another over a duration, with a phase.
    Chirp { from: f64, to: f64, duration: f64, phase: f64, amplitude: f64 },
    /// Nothing: the plant decays freely.
    Rest,
}

impl Signal {
    /// A random signal in a band of frequencies over a duration.
    pub fn draw(draw: &mut Draw, band: (f64, f64), duration: f64) -> Self {
        match draw.index(10) {
            0..=3 => Self::multisine(draw, band),
            4..=6 => Self::steps(draw, band, duration),
            7 => Self::Chirp {
                from: band.0,
                to: band.1,
                duration,
                phase: draw.uniform(0.0, TAU),
                amplitude: draw.uniform(0.6, 1.0),
            },
            // Filtered noise: a dense multisine with falling amplitudes.
            _ => {
                let n = 24;
                let lines = (0..n)
                    .map(|_| {
                        let f = draw.uniform(0.5 * band.0, 1.5 * band.1);
                        let fall = 1.0 / (1.0 + (f / (0.5 * (band.0 + band.1))).powi(2));
                        (0.45 * fall * draw.normal(), f, draw.uniform(0.0, TAU))
                    })
                    .collect();
                Self::Multisine(lines)
            }
        }
    }

    /// Three to seven sines whose amplitudes add up to about one.
    pub fn multisine(draw: &mut Draw, band: (f64, f64)) -> Self {
        let n = draw.integer(3, 7);
        let amplitude = 1.1 / (n as f64).sqrt();
        let lines = (0..n)
            .map(|i| {
                let share = (i as f64 + draw.unit()) / n as f64;
                let f = band.0 * (band.1 / band.0).powf(share);
                (amplitude * draw.uniform(0.5, 1.0), f, draw.uniform(0.0, TAU))
            })
            .collect();
        Self::Multisine(lines)
    }

    /// Random levels, each held for a while.
    pub fn steps(draw: &mut Draw, band: (f64, f64), duration: f64) -> Self {
        let mut list = Vec::new();
        let mut t = 0.0;
        let both = draw.chance(0.4);
        while t < duration {
            t += draw.uniform(0.25, 1.0) / (band.0 * band.1).sqrt();
            list.push((t, if both { draw.sign() } else { draw.uniform(-1.0, 1.0) }));
        }
        Self::Steps(list)
    }

    /// Value and derivative at a time since the start of the run.
    pub fn at(&self, t: f64) -> (f64, f64) {
        match self {
            Self::Multisine(lines) => lines.iter().fold((0.0, 0.0), |(v, d), &(a, f, phase)| {
                let angle = TAU * f * t + phase;
                (v + a * angle.sin(), d + a * TAU * f * angle.cos())
            }),
            Self::Steps(list) => {
                let seen = list.partition_point(|&(end, _)| end <= t).min(list.len().saturating_sub(1));
                (list.get(seen).map_or(0.0, |s| s.1), 0.0)
            }
            Self::Chirp { from, to, duration, phase, amplitude } => {
                let angle = TAU * (from * t + 0.5 * (to - from) / duration * t * t) + phase;
                let rate = TAU * (from + (to - from) / duration * t);
                (amplitude * angle.sin(), amplitude * rate * angle.cos())
            }
            Self::Rest => (0.0, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivative_of_a_signal_is_its_slope() {
        let mut draw = Draw::new(5, 0);
        for signal in [
            Signal::multisine(&mut draw, (0.2, 2.0)),
            Signal::Chirp { from: 0.2, to: 2.0, duration: 10.0, phase: 0.3, amplitude: 0.7 },
        ] {
            let (h, t) = (1e-5, 3.3);
            let slope = (signal.at(t + h).0 - signal.at(t - h).0) / (2.0 * h);
            // Central differences: error h^2 times the third derivative.
            assert!((signal.at(t).1 - slope).abs() < 1e-6);
        }
    }
}
