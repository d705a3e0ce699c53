//! Sensors: white and coloured noise, counts of an encoder, outliers, missing cells.

use crate::plant::Plant;
use crate::random::{Draw, digits};
use crate::simulate::{Commands, Setup, Trace};
use crate::survey::Survey;

/// How the columns of a case are read.
#[derive(Debug, Clone)]
pub struct Sensing {
    /// Standard deviation by logged column, the share of the counts included.
    pub noise: Vec<f64>,
    /// What may mislead, in words; empty: white noise.
    pub trap: String,
    /// Nothing but white noise?
    pub plain: bool,
    sigma: Vec<f64>,
    count: Vec<f64>,
    memory: f64,
    outliers: f64,
    missing: f64,
}

/// The noise stream of a run.
pub struct Noise {
    draw: Draw,
    dropped: Draw,
}

impl Noise {
    /// The stream of run `k`; the same one in every repetition of the run.
    pub fn of_run(seed: u64, attempt: u64, k: usize) -> Self {
        let stream = 1000 + 100 * attempt + 2 * k as u64;
        Self { draw: Draw::new(seed, stream), dropped: Draw::new(seed, stream + 1) }
    }
}

impl Sensing {
    /// Draws the sensors of a plant; a null case has traps oftener.
    pub fn draw(plant: &Plant, survey: &Survey, null: bool, draw: &mut Draw) -> Self {
        let share = draw.log(0.004, 0.04);
        let mut sigma = Vec::new();
        for &i in &plant.logged {
            sigma.push(digits(survey.spread[i] * share * draw.log(0.6, 1.6), 2));
        }
        let mut sensing = Self {
            noise: sigma.clone(),
            trap: String::new(),
            plain: true,
            count: vec![0.0; sigma.len()],
            memory: 0.0,
            outliers: 0.0,
            missing: if draw.chance(0.15) { draw.uniform(0.01, 0.05) } else { 0.0 },
            sigma,
        };
        match draw.unit() {
            s if null && s < 0.12 => {
                sensing.memory = 0.8;
                sensing.trap = "coloured sensor noise, AR(1) 0.8".into();
            }
            s if null && s < 0.22 => {
                sensing.outliers = 0.01;
                sensing.trap = "1 % outliers".into();
            }
            s if s < if null { 0.34 } else { 0.08 } => {
                for (count, (sigma, noise)) in
                    sensing.count.iter_mut().zip(sensing.sigma.iter().zip(&mut sensing.noise))
                {
                    *count = digits(sigma * draw.log(1.0, 4.0), 2);
                    *noise = sigma.hypot(*count / 12f64.sqrt());
                }
                sensing.trap = "counts of the sensors are coarse".into();
            }
            _ => {}
        }
        sensing.plain = sensing.trap.is_empty();
        if sensing.missing > 0.0 {
            let word = "missing cells";
            sensing.trap = if sensing.trap.is_empty() { word.into() } else { format!("{}, {word}", sensing.trap) };
        }
        sensing
    }

    /// Errors of every logged column of a run of `n` samples, before counting.
    fn errors(&self, n: usize, noise: &mut Noise) -> Vec<Vec<f64>> {
        let columns = self.sigma.len();
        let fresh = (1.0 - self.memory * self.memory).sqrt();
        let mut last: Vec<f64> = (0..columns).map(|_| noise.draw.normal()).collect();
        (0..n)
            .map(|_| {
                (0..columns)
                    .map(|c| {
                        last[c] = self.memory * last[c] + fresh * noise.draw.normal();
                        let stray = noise.draw.chance(self.outliers);
                        let jump = noise.draw.normal();
                        self.sigma[c] * (last[c] + if stray { 15.0 * jump } else { 0.0 })
                    })
                    .collect()
            })
            .collect()
    }

    /// Gives closed loops the noise that their controllers see.
    pub fn feed_back(&self, plant: &Plant, setups: &mut [Setup], seed: u64, attempt: u64) {
        for (k, setup) in setups.iter_mut().enumerate() {
            if let Commands::Closed { noise, .. } = &mut setup.commands {
                let errors = self.errors(setup.times.len(), &mut Noise::of_run(seed, attempt, k));
                for (row, error) in noise.iter_mut().zip(errors) {
                    for (&i, e) in plant.logged.iter().zip(error) {
                        row[i] = e;
                    }
                }
            }
        }
    }

    /// The log of a run.
    pub fn read(&self, plant: &Plant, setup: &Setup, trace: &Trace, noise: &mut Noise) -> Vec<Vec<f64>> {
        let errors = self.errors(setup.times.len(), noise);
        let mut log = Vec::with_capacity(errors.len());
        for (k, error) in errors.iter().enumerate() {
            let mut row = Vec::with_capacity(error.len());
            for (c, &i) in plant.logged.iter().enumerate() {
                let mut value = trace.readings[k][i] + error[c];
                if self.count[c] > 0.0 {
                    value = (value / self.count[c]).round() * self.count[c];
                }
                let gone = noise.dropped.chance(self.missing);
                row.push(if gone && k > 0 { f64::NAN } else { digits(value, 6) });
            }
            log.push(row);
        }
        log
    }
}
