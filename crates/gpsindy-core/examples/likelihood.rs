//! One likelihood with gradient, again and again, so that a script can take the processor's time of it:
//!
//! ```text
//! cargo run --release -p gpsindy-core --example likelihood -- dense|toeplitz|uniform|irregular|smooth|smooth-uniform POINTS TIMES
//! ```
//!
//! `dense` and `toeplitz` take the squared exponential, `uniform` and `irregular` the state space of Matern 5/2, and
//! `smooth` (irregular) and `smooth-uniform` its posterior of value and derivative at every point.

use gpsindy_core::gp::{Conditioned, Engine, Evaluation, Fit, FitSettings, Kernel, Points, Quantity, Workspace, fit};

fn points(n: usize, irregular: bool) -> Points {
    let shift = |i: usize| if irregular { 0.03 * (i as f64).sin() } else { 0.0 };
    let time: Vec<f64> = (0..n).map(|i| 0.1 * i as f64 + shift(i)).collect();
    let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.1 * (37.0 * t * t).sin()).collect();
    Points::in_time(&time, &values)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [what, n, repeats] = arguments.as_slice() else {
        return Err("expected ENGINE POINTS TIMES".into());
    };
    let (n, repeats): (usize, usize) = (n.parse()?, repeats.parse()?);
    let (kernel, engine) = match what.as_str() {
        "dense" => (Kernel::SquaredExponential, Engine::Dense),
        "toeplitz" => (Kernel::SquaredExponential, Engine::Toeplitz),
        "uniform" | "irregular" | "smooth" | "smooth-uniform" => (Kernel::Matern52, Engine::StateSpace),
        other => return Err(format!("unknown engine `{other}`").into()),
    };
    let points = points(n, matches!(what.as_str(), "irregular" | "smooth"));
    if what.starts_with("smooth") {
        let fitted: Fit = fit(&[kernel], &[self::points(200, true)], &FitSettings::default())?;
        let both = [Quantity::Value, Quantity::Derivative];
        for _ in 0..repeats {
            std::hint::black_box(Conditioned::new(&fitted, &points)?.predict(&points.inputs, &both, false)?);
        }
        return Ok(());
    }
    let evaluation = Evaluation { kernel: &kernel, hyper: &[0.0, 0.0, -2.0], jitter: 0.0 };
    let (mut gradient, mut workspace) = ([0.0; 3], Workspace::default());
    for _ in 0..repeats {
        let nll = evaluation.likelihood_by(engine, &points, &mut gradient, &mut workspace);
        std::hint::black_box(nll.ok_or("the covariance is not positive definite")?);
    }
    Ok(())
}
