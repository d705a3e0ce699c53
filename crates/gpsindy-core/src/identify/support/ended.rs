//! The end of a fit, made only once.

use crate::error::Result;
use crate::identify::algorithm1::made::Ended;
use crate::identify::equations::Equations;
use crate::identify::evidence::independent_share;
use crate::identify::limits::USUAL;
use crate::identify::support::fit::{Fitter, sums};
use crate::model::System;
use crate::refine::{Experiment, Free, Hold, Point, Refine};

impl Fitter<'_> {
    /// The end of the fit of `equations`, whose system is `system`, from `start`; costs above `hopeless` end it once its steps gain little.
    pub(crate) fn ended(
        &self,
        equations: &Equations,
        (system, experiment): (&System, &Experiment),
        start: &Point,
        free: &[Free],
        hopeless: f64,
    ) -> Result<Ended> {
        self.made.get(key(equations, experiment, start, free, hopeless), || {
            let settings = Refine { hopeless, ..USUAL };
            let refined = settings.fit(system, experiment, &start.parameters, free, Some(&start.initial))?;
            let (squares, counts) = sums(experiment, &refined.residuals);
            Ok(Ended {
                squares,
                counts,
                share: independent_share(&refined.residuals, experiment.noise.len()),
                errors: (0..free.len()).map(|k| refined.covariance[k][k].max(0.0).sqrt()).collect(),
                converged: refined.converged,
                point: Point { parameters: refined.parameters, initial: refined.initial },
            })
        })
    }
}

/// All that a fit to the same logs depends on. Terms enter by their names, since their numbers differ from library to library.
fn key(equations: &Equations, experiment: &Experiment, start: &Point, free: &[Free], hopeless: f64) -> Vec<u8> {
    let mut key = equations.structure().into_bytes();
    key.push(u8::from(experiment.hold == Hold::Linear));
    let windows = experiment.windows.iter().flat_map(|w| [w.log, w.first, w.last]);
    windows.for_each(|place| key.extend(place.to_le_bytes()));
    let limits = free.iter().flat_map(|f| [f.scale, f.lower, f.upper]);
    let start = start.parameters.iter().chain(start.initial.iter().flatten()).copied();
    let values = start.chain(experiment.noise.iter().copied()).chain(limits).chain([hopeless]);
    values.for_each(|value| key.extend(value.to_le_bytes()));
    key
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::identify::algorithm1::Algorithm1;
    use crate::identify::settings::Identify;
    use crate::identify::support::scope::Scope;
    use crate::identify::tests::log;
    use crate::library::LibrarySettings;
    use crate::progress::Silent;
    use crate::refine::Hold;

    #[test]
    fn a_larger_library_comes_to_the_fits_of_a_smaller_one_without_making_them_again() {
        let data = log(&["x"], &[1.0], &|_, x| vec![-x[0]], (0.1, 60), 0.02, &|_| vec![], 1);
        let with_degree = |degree| Identify {
            states: vec!["x".into()],
            library: LibrarySettings { degree, ..LibrarySettings::default() },
            ..Identify::default()
        };
        let (small, large) = (with_degree(1), with_degree(3));
        let done = Algorithm1::run(&small, &data, &Silent).unwrap();
        let more = Algorithm1::with_library_of(&large, (&done.logs, &done.motion), &Silent).unwrap();
        let fits = [(&small, &done), (&large, &more)].map(|(settings, done)| {
            let mut equations = done.regressed.equations.clone();
            let x = equations.library.index_of("x").unwrap();
            let coefficients: Vec<f64> = (0..equations.n_terms()).map(|j| if j == x { -0.9 } else { 0.0 }).collect();
            equations.set(0, &coefficients);
            let trial = Scope::new(settings, done, &Silent).fitter(Hold::Zero).fit(&equations, 2.0, None).unwrap();
            (trial.equations.coefficients[0][x], trial.squares, done.motion.made.count())
        });
        assert_eq!(fits[0], fits[1]);
        assert!(fits[0].2 > 0);
    }
}
