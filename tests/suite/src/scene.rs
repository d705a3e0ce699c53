//! The runs of a case: sample times, starts, excitations, references.

use crate::case::HELD_OUT;
use crate::excite::Signal;
use crate::plant::{Plant, Row};
use crate::random::{Draw, digits};
use crate::simulate::{Commands, Setup};

/// Sample times of a run of `n` samples that starts at `first`.
fn times(draw: &mut Draw, n: usize, interval: f64, first: f64, irregular: bool) -> Vec<f64> {
    let tick = 10f64.powf(interval.log10().floor() - 2.0);
    let round = |t: f64| digits((t / tick).round() * tick, 9);
    let mut t = first;
    let mut list = Vec::with_capacity(n);
    for k in 0..n {
        list.push(round(if irregular { t } else { first + interval * k as f64 }));
        t += interval * draw.uniform(0.6, 1.4);
    }
    list
}

/// The runs of a case before they are made.
pub(crate) struct Scene {
    pub(crate) setups: Vec<Setup>,
    pub(crate) given: usize,
    pub(crate) interval: f64,
}

/// The runs of a plant, with the sensor noise of a closed loop still zero.
pub(crate) fn scene(plant: &Plant, draw: &mut Draw, null: bool) -> Scene {
    let rate = plant.rate.clamp(2.0, 200.0);
    let interval = digits(1.0 / rate, 2);
    let wanted = plant.duration * rate * draw.uniform(0.7, 1.3);
    let n = if draw.chance(0.08) { (2.0 * wanted).clamp(1000.0, 3000.0) } else { wanted.clamp(300.0, 1500.0) } as usize;
    let given = draw.integer(3, 6);
    let irregular = plant.feedback.is_none() && draw.chance(0.15);
    let goes_on = draw.chance(0.15);
    let linear = null && plant.feedback.is_none() && draw.chance(0.12);
    let mut first = 0.0;
    let mut setups = Vec::new();
    for run in 0..given + HELD_OUT {
        let times = times(draw, n, interval, first, irregular);
        let duration = interval * n as f64;
        if goes_on {
            first = digits(times[n - 1] + duration * draw.uniform(0.05, 0.2), 4);
        }
        let factor = if run < given { draw.uniform(0.6, 1.1) } else { draw.uniform(0.6, 1.2) };
        let start: Vec<f64> =
            plant.states.iter().map(|s| digits(s.start.0 + s.start.1 * draw.uniform(-1.0, 1.0), 5)).collect();
        let commands = match &plant.feedback {
            None => open(plant, draw, &times, factor, duration),
            Some(_) => closed(plant, draw, &times, factor),
        };
        setups.push(Setup { times, start, commands, linear });
    }
    Scene { setups, given, interval }
}

fn open(plant: &Plant, draw: &mut Draw, times: &[f64], factor: f64, duration: f64) -> Commands {
    let rest = draw.chance(0.06);
    let signals: Vec<Signal> = plant
        .controls
        .iter()
        .map(|_| if rest { Signal::Rest } else { Signal::draw(draw, plant.band, duration) })
        .collect();
    let row = |&t: &f64| {
        let value = |(signal, control): (&Signal, &crate::plant::Control)| {
            let u = control.centre + factor * control.amplitude * signal.at(t - times[0]).0;
            digits(if control.one_way { u.max(0.0) } else { u }, 6)
        };
        signals.iter().zip(&plant.controls).map(value).collect()
    };
    Commands::Open(times.iter().map(row).collect())
}

fn closed(plant: &Plant, draw: &mut Draw, times: &[f64], factor: f64) -> Commands {
    let n = plant.states.len();
    let feedback = plant.feedback.as_ref();
    let list = feedback.map_or(&[][..], |f| &f.reference[..]);
    let signals: Vec<(usize, f64, Signal)> = list
        .iter()
        .map(|&(i, amplitude)| {
            let steps = draw.chance(0.25);
            let duration = times[times.len() - 1] - times[0];
            let band = plant.band;
            let signal = if steps { Signal::steps(draw, band, duration) } else { Signal::multisine(draw, band) };
            (i, amplitude * factor, signal)
        })
        .collect();
    let row = |&t: &f64| {
        let mut reference: Vec<f64> = vec![0.0; n];
        for (i, state) in plant.states.iter().enumerate() {
            if plant.rows[i] == Row::Kinematic {
                reference[i] = state.start.0;
            }
        }
        for (i, amplitude, signal) in &signals {
            let (value, slope) = signal.at(t - times[0]);
            reference[*i] += amplitude * value;
            for (v, kind) in plant.rows.iter().enumerate() {
                if matches!(kind, Row::Force { position: Some(q), .. } if q == i) {
                    reference[v] = amplitude * slope;
                }
            }
        }
        reference
    };
    let reference: Vec<Vec<f64>> = times.iter().map(row).collect();
    let zero = vec![vec![0.0; n]; times.len()];
    Commands::Closed { reference, noise: zero, dither: vec![vec![0.0; plant.controls.len()]; times.len()] }
}
