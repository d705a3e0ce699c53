//! The generated logs of `data/`: one seed, integrated by code that shares nothing with the program that reads them.
//!
//! Lotka-Volterra and unicycle follow Hsin et al., section V: the same equations, parameters and initial state of the unicycle;
//! "derivatives given" means the true right side plus noise of the same standard deviation as the states'.

use crate::bag;
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use std::fmt::Write;
use std::path::{Path, PathBuf};

const SEED: u64 = 1;

/// Files of `data/` that the program carries for `gpsindy demo`: a packed crate holds nothing from outside its folder.
const CARRIED: [&str; 3] = ["lotka_volterra.csv", "pendulum.csv", "pendulum.toml"];

/// A log of topics in `data/`, and the map of its columns next to it.
const BAG: &str = "pendulum.mcap";

/// Writes every generated file into `data/`, and what the program carries into its crate.
pub(crate) fn write() -> Result<(), String> {
    let root = crate::shell::root();
    let failed = |path: &Path, e: std::io::Error| format!("{}: {e}", path.display());
    for (name, text) in files() {
        let path = root.join("data").join(name);
        std::fs::write(&path, text).map_err(|e| failed(&path, e))?;
        crate::shell::complain(&format!("wrote {}", path.display()));
    }
    let path = root.join("data").join(BAG);
    std::fs::write(&path, pendulum_bag()?).map_err(|e| failed(&path, e))?;
    crate::shell::complain(&format!("wrote {}", path.display()));
    for name in CARRIED {
        let path = carried(name);
        std::fs::copy(root.join("data").join(name), &path).map_err(|e| failed(&path, e))?;
        crate::shell::complain(&format!("wrote {}", path.display()));
    }
    Ok(())
}

fn carried(name: &str) -> PathBuf {
    crate::shell::root().join("crates/gpsindy-cli/demo").join(name)
}

/// Name and text of every generated file.
fn files() -> [(&'static str, String); 3] {
    [("lotka_volterra.csv", lotka_volterra()), ("unicycle.csv", unicycle()), ("pendulum.csv", pendulum())]
}

/// Independent standard normal numbers, by Box and Muller.
struct Normal(ChaCha8Rng);

impl Normal {
    fn new(stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(SEED);
        generator.set_stream(stream);
        Self(generator)
    }

    /// Uniform in (0, 1).
    fn uniform(&mut self) -> f64 {
        (((self.0.next_u64() >> 11) as f64) + 0.5) / (1u64 << 53) as f64
    }

    fn draw(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// One step of the classical Runge-Kutta method for `x' = f(t, x)`.
fn runge_kutta<const N: usize>(f: impl Fn(f64, [f64; N]) -> [f64; N], t: f64, x: [f64; N], h: f64) -> [f64; N] {
    let along = |k: [f64; N], step: f64| std::array::from_fn(|i| x[i] + step * k[i]);
    let k1 = f(t, x);
    let k2 = f(t + h / 2.0, along(k1, h / 2.0));
    let k3 = f(t + h / 2.0, along(k2, h / 2.0));
    let k4 = f(t + h, along(k3, h));
    std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// States and given derivatives with noise of standard deviation `noise`, sampled every 0.1 s, as rows of a CSV file.
fn sampled<const N: usize>(
    f: impl Fn(f64, [f64; N]) -> [f64; N],
    mut x: [f64; N],
    n_samples: usize,
    noise: f64,
    normal: &mut Normal,
    controls: impl Fn(f64) -> Vec<f64>,
) -> String {
    const PERIOD: f64 = 0.1;
    const STEPS: usize = 100;
    let mut text = String::new();
    for sample in 0..n_samples {
        let start = sample as f64 * PERIOD;
        let _ = write!(text, "{start:.1}");
        for value in x.into_iter().chain(f(start, x)) {
            let _ = write!(text, ",{:.5}", value + noise * normal.draw());
        }
        for value in controls(start) {
            let _ = write!(text, ",{value:.6}");
        }
        text.push('\n');
        let h = PERIOD / STEPS as f64;
        for step in 0..STEPS {
            x = runge_kutta(&f, start + step as f64 * h, x, h);
        }
    }
    text
}

fn lotka_volterra() -> String {
    let f = |_t: f64, [x1, x2]: [f64; 2]| [1.1 * x1 - 0.4 * x1 * x2, -x2 + 0.4 * x1 * x2];
    let mut text = String::from(
        "# Lotka-Volterra: x1' = 1.1*x1 - 0.4*x1*x2, x2' = -x2 + 0.4*x1*x2, from (10, 5)\n\
         # noise of standard deviation 0.05 on every column; dx1 and dx2 are noisy derivatives; cargo xtask data\n\
         t [s],x1,x2,dx1 [1/s],dx2 [1/s]\n",
    );
    text += &sampled(f, [10.0, 5.0], 301, 0.05, &mut Normal::new(1), |_| Vec::new());
    text
}

fn unicycle() -> String {
    let controls = |t: f64| vec![t.sin(), 0.5 * t.cos()];
    let f = |t: f64, [_, _, x3, x4]: [f64; 4]| [x3 * x4.cos(), x3 * x4.sin(), t.sin(), 0.5 * t.cos()];
    let mut text = String::from(
        "# Unicycle: x1' = x3*cos(x4), x2' = x3*sin(x4), x3' = u1, x4' = u2, with u1 = sin(t), u2 = cos(t)/2, from (0, 0, 0.5, 0.5)\n\
         # noise of standard deviation 0.05 on states and derivatives; the controls are exact and not held; cargo xtask data\n\
         t [s],x1 [m],x2 [m],x3 [m/s],x4 [rad],dx1 [m/s],dx2 [m/s],dx3 [m/s^2],dx4 [rad/s],u1 [m/s^2],u2 [rad/s]\n",
    );
    text += &sampled(f, [0.0, 0.0, 0.5, 0.5], 301, 0.05, &mut Normal::new(2), controls);
    text
}

/// A driven pendulum whose bearing has dry friction.
///
/// `phi' = omega`, `omega' = -9.81*sin(phi) - 0.1*omega - friction + 2*u`, where friction is 0.35 rad/s^2 against the
/// motion, and holds the pendulum at rest as long as the other torques stay below it.
struct Pendulum {
    phi: f64,
    omega: f64,
}

impl Pendulum {
    /// Moves on by `steps` steps of `h` seconds under one torque.
    fn advance(&mut self, torque: f64, h: f64, steps: usize) {
        const DRY: f64 = 0.35;
        for _ in 0..steps {
            let smooth = -9.81 * f64::sin(self.phi) - 0.1 * self.omega + 2.0 * torque;
            let pushed: f64 = self.omega + h * smooth;
            // Dry friction takes away speed but never turns it round.
            self.omega = pushed.signum() * (pushed.abs() - h * DRY).max(0.0);
            self.phi += h * self.omega;
        }
    }
}

/// Four runs of the pendulum as a table; the torque is held between samples.
fn pendulum() -> String {
    const PERIOD: f64 = 0.04;
    const STEPS: usize = 400;
    let mut normal = Normal::new(3);
    let mut text = String::from(
        "# Driven pendulum, 4 runs: phi' = omega, omega' = -9.81*sin(phi) - 0.1*omega + 2*u - dry friction of 0.35 rad/s^2\n\
         # noise 0.003 rad and 0.02 rad/s, torque held between samples; pendulum.toml lacks the friction; cargo xtask data\n\
         run,t [s],phi [rad],omega [rad/s],u [N*m]\n",
    );
    for run in 1..=4 {
        let mut pendulum = Pendulum { phi: 1.2 * normal.draw(), omega: 0.0 };
        let (mut torque, mut hold) = (0.0, 0);
        for sample in 0..400 {
            if hold == 0 {
                torque = (100.0 * 1.5 * normal.draw()).round() / 100.0;
                hold = 5 + (25.0 * normal.uniform()) as usize;
            }
            hold -= 1;
            let (angle, rate) = (pendulum.phi + 0.003 * normal.draw(), pendulum.omega + 0.02 * normal.draw());
            let _ = writeln!(text, "{run},{:.2},{angle:.4},{rate:.4},{torque:.2}", sample as f64 * PERIOD);
            pendulum.advance(torque, PERIOD / STEPS as f64, STEPS);
        }
    }
    text
}

/// Forty seconds of the same pendulum as a robot records it: commands at 25 Hz and joint states at 50 Hz, each by a cycle of its
/// own with jitter of up to 2 ms, so that no command has the stamp of a state. A torque acts from its stamp on.
fn pendulum_bag() -> Result<Vec<u8>, String> {
    const BEGIN: i64 = 1_767_600_000_000_000_000;
    const TICKS: i64 = 40_000;
    let mut normal = Normal::new(10);
    let mut bag = bag::Bag::new()?;
    let (states, commands) = (bag.channel("/joint_states")?, bag.channel("/joint_commands")?);
    let mut pendulum = Pendulum { phi: 1.2 * normal.draw(), omega: 0.0 };
    let (mut torque, mut hold) = (0.0, 0);
    let mut jitter = Normal::new(11);
    let mut late = || (3.0 * jitter.uniform()) as i64;
    // The first command is there before the first state.
    let (mut command, mut state, mut cycle) = (0, 13, 0);
    for tick in 0..TICKS {
        let now = BEGIN + tick * 1_000_000;
        // Both reach the recorder a little later.
        if tick == command {
            if hold == 0 {
                torque = (100.0 * 1.5 * normal.draw()).round() / 100.0;
                hold = 3 + (15.0 * normal.uniform()) as usize;
            }
            hold -= 1;
            bag.write(commands, now, now + 500_000, [None, None, Some(torque)])?;
            cycle += 1;
            command = 40 * cycle + late();
        }
        if tick == state {
            let angle = (1e4 * (pendulum.phi + 0.003 * normal.draw())).round() / 1e4;
            let rate = (1e4 * (pendulum.omega + 0.02 * normal.draw())).round() / 1e4;
            bag.write(states, now, now + 400_000, [Some(angle), Some(rate), None])?;
            state = 20 * ((state + 20) / 20) + 13 + late();
        }
        pendulum.advance(torque, 1e-4, 10);
    }
    bag.done()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_in_data_are_what_the_generator_writes() {
        for (name, text) in files() {
            let kept = std::fs::read_to_string(crate::shell::root().join("data").join(name)).unwrap();
            assert_eq!(kept.len(), text.len(), "{name}");
            // Sine and cosine may differ in the last bit between platforms, which can move a rounded digit.
            for (a, b) in kept.lines().zip(text.lines()) {
                for (a, b) in a.split(',').zip(b.split(',')) {
                    match (a.parse::<f64>(), b.parse::<f64>()) {
                        (Ok(a), Ok(b)) => assert!((a - b).abs() < 3e-4, "{name}: {a} and {b}"),
                        _ => assert_eq!(a, b, "{name}"),
                    }
                }
            }
        }
    }

    #[test]
    fn the_bag_in_data_is_what_the_generator_writes() {
        let kept = std::fs::read(crate::shell::root().join("data").join(BAG)).unwrap();
        let (kept, written) = (bag::numbers(&kept), bag::numbers(&pendulum_bag().unwrap()));
        assert_eq!(kept.len(), written.len());
        for ((time, a), (other, b)) in kept.iter().zip(&written) {
            assert_eq!((time, a.len()), (other, b.len()));
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 3e-4), "{time}: {a:?} and {b:?}");
        }
    }

    #[test]
    fn the_program_carries_the_files_of_data() {
        for name in CARRIED {
            let kept = std::fs::read(crate::shell::root().join("data").join(name)).unwrap();
            assert_eq!(std::fs::read(carried(name)).unwrap(), kept, "{name}");
        }
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let mut normal = Normal::new(9);
        let draws: Vec<f64> = (0..100_000).map(|_| normal.draw()).collect();
        let mean = draws.iter().sum::<f64>() / 1e5;
        let variance = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / 1e5;
        // Five standard errors: 5/sqrt(1e5) and 5*sqrt(2/1e5).
        assert!(mean.abs() < 0.016 && (variance - 1.0).abs() < 0.023, "{mean} {variance}");
    }
}
