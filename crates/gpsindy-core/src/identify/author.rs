//! The pipeline behind the paper's tables as its authors ran it, including its slips, so that their numbers can be reproduced.
//!
//! One run at a time: raw samples, symmetric differences over the whole record, ADMM with loose tolerances, one lambda for
//! all states by the open-loop error on the training part, forward Euler, errors as Frobenius norms against the noisy log.
//! For an identification of your own use [`super::Identify`].

use crate::data::{Dataset, Run};
use crate::differentiate::{SecondStage, slope};
use crate::error::{Error, Result};
use crate::gp::Kernel;
use crate::identify::limits::AUTHORS_TRAIN;
use crate::library::{Library, LibrarySettings};
use crate::model::{Control, IdentificationRecord, Model, State};
use crate::progress::Progress;
use crate::regress::{Lasso, Regressor};
use crate::smooth::Smoother;
use faer::Mat;

/// Settings of the authors' pipeline.
///
/// | setting | default | purpose |
/// | --- | --- | --- |
/// | `states`, `controls` | | columns of the log |
/// | `derivatives` | none | (state, column) pairs: taken in place of differences, as for the simulated systems |
/// | `library` | degree 1 and products | candidate terms, as for the car |
/// | `train_fraction` | 0.7 | first part that is learnt from |
/// | `inputs` | `None` | `None`: their SINDy; else their GPSINDy and the inputs of its second stage |
/// | `kernels` | twelve | of both stages; the squared exponential alone for their simulated systems |
/// | `lambda` | `None` | `None`: the open-loop error on the training part decides; 0.1 for their simulated systems |
#[derive(Debug, Clone)]
pub struct Author {
    /// Columns that are states.
    pub states: Vec<String>,
    /// Columns that are controls.
    pub controls: Vec<String>,
    /// State and the column that carries its derivative; the other states are differenced.
    pub derivatives: Vec<(String, String)>,
    /// Candidate terms; default degree 1 with sine, cosine and products, as for the car.
    pub library: LibrarySettings,
    /// Share of the samples that is learnt from; the rest, from the last of them on, is the test. Default 0.7.
    pub train_fraction: f64,
    /// `None`: SINDy. Else GPSINDy: for each state the inputs of the Gaussian process of its derivative; an empty list
    /// means all smoothed states. For the car: none, none, the throttle, the steering.
    pub inputs: Option<Vec<Vec<String>>>,
    /// Kernels that compete by likelihood, in both stages.
    pub kernels: Vec<Kernel>,
    /// Weight of the 1-norm, at least 0.
    pub lambda: Option<f64>,
}

impl Default for Author {
    fn default() -> Self {
        let base = [Kernel::SquaredExponential, Kernel::Matern12, Kernel::Matern32, Kernel::RationalQuadratic];
        let with = |join: fn(Box<Kernel>, Box<Kernel>) -> Kernel| {
            base.iter().map(move |k| join(Box::new(k.clone()), Box::new(Kernel::Periodic))).collect::<Vec<_>>()
        };
        let kernels = base.iter().cloned().chain(with(Kernel::Sum)).chain(with(Kernel::Product)).collect();
        Self {
            states: Vec::new(),
            controls: Vec::new(),
            derivatives: Vec::new(),
            library: LibrarySettings { degree: 1, products: true, ..LibrarySettings::default() },
            train_fraction: AUTHORS_TRAIN,
            inputs: None,
            kernels,
            lambda: None,
        }
    }
}

/// What the authors' pipeline reports.
#[derive(Debug, Clone)]
pub struct AuthorResult {
    /// The model; its rollouts by any other integrator than forward Euler differ.
    pub model: Model,
    /// The lambda chosen.
    pub lambda: f64,
    /// Frobenius norm of the open-loop error on the training part, mixed units; not finite where the rollout diverges.
    pub train_error: f64,
    /// The same on the rest.
    pub test_error: f64,
}

/// Their lambdas: 1e-6 ... 0.1 in decades, 1 to 10, 20 to 100.
fn lambdas() -> Vec<f64> {
    let decades = (0..6).map(|k| 10f64.powi(k - 6));
    decades.chain((1..=10).map(f64::from)).chain((2..=10).map(|k| f64::from(10 * k))).collect()
}

impl Author {
    /// Learns from the first part of the only run of `data` and tests on the rest.
    ///
    /// # Errors
    /// Not exactly one run, missing values, unknown columns, too few samples, a setting out of range, no lambda whose
    /// rollout stays finite.
    pub fn fit(&self, data: &Dataset, progress: &dyn Progress) -> Result<AuthorResult> {
        let [run] = data.runs() else {
            let found = format!("{} runs", data.runs().len());
            return Err(Error::shape("data of the authors' pipeline", "one run", found));
        };
        let states = data.indices_of(&self.states)?;
        let controls = data.indices_of(&self.controls)?;
        let given = self.given(data)?;
        if let Some(&c) = states
            .iter()
            .chain(&controls)
            .chain(given.iter().flatten())
            .find(|&&c| run.column(c).iter().any(|v| !v.is_finite()))
        {
            return Err(Error::NotFinite {
                what: format!("run `{}`, channel `{}`", run.name, data.channels()[c].name),
            });
        }
        if self.lambda.is_some_and(|lambda| !(lambda.is_finite() && lambda >= 0.0)) {
            return Err(Error::range("lambda", "at least 0", self.lambda.unwrap_or(f64::NAN)));
        }
        let n_train = (self.train_fraction * run.n_samples() as f64).round() as usize;
        if n_train < 4 || n_train >= run.n_samples() {
            return Err(Error::TooFewSamples {
                what: format!("run `{}`", run.name),
                needed: 8,
                found: run.n_samples(),
            });
        }
        let library = Library::new(&self.states, &self.controls, &self.library)?;
        let (x, dx) = self.training(data, run, (&states, &given), n_train, progress)?;
        let n = states.len();
        let rows =
            Mat::from_fn(
                n_train,
                n + controls.len(),
                |i, j| {
                    if j < n { x[(i, j)] } else { run.values[(i, controls[j - n])] }
                },
            );
        let theta = library.evaluate(rows.as_ref(), &run.time[..n_train])?;
        let logged = Mat::from_fn(run.n_samples(), n + controls.len(), |i, j| {
            run.values[(i, if j < n { states[j] } else { controls[j - n] })]
        });

        let mut best: Option<(f64, f64, Vec<Vec<f64>>)> = None;
        let candidates = self.lambda.map_or_else(lambdas, |lambda| vec![lambda]);
        for lambda in candidates {
            let one = |j: usize| Ok(Lasso::author(lambda).fit(theta.as_ref(), dx.col_as_slice(j))?.coefficients);
            let coefficients: Vec<Vec<f64>> = (0..n).map(one).collect::<Result<_>>()?;
            let error = euler_error(&library, &coefficients, run, &logged, (0, n_train));
            // A lambda that was given is no candidate among others: what it finds is the result.
            let usable = error.is_finite() || self.lambda.is_some();
            if usable && best.as_ref().is_none_or(|(_, least, _)| error < *least) {
                best = Some((lambda, error, coefficients));
            }
        }
        let Some((lambda, train_error, coefficients)) = best else {
            let why = "every lambda's rollout diverges on the training part".into();
            return Err(Error::NotConverged { what: "the authors' pipeline".into(), why });
        };
        let test_error = euler_error(&library, &coefficients, run, &logged, (n_train - 1, run.n_samples()));
        Ok(AuthorResult { model: self.model(&library, lambda, coefficients), lambda, train_error, test_error })
    }

    /// The column of the derivative of each state, where the log carries one.
    fn given(&self, data: &Dataset) -> Result<Vec<Option<usize>>> {
        if let Some((state, _)) = self.derivatives.iter().find(|(state, _)| !self.states.contains(state)) {
            return Err(Error::unknown("state", state, self.states.iter().map(String::as_str)));
        }
        let column =
            |state: &String| self.derivatives.iter().find(|(s, _)| s == state).map(|(_, column)| column.clone());
        let index = |name: String| Ok(data.indices_of(&[name])?[0]);
        self.states.iter().map(|state| column(state).map(index).transpose()).collect()
    }

    /// States and derivatives that the regression sees (train x n each).
    fn training(
        &self,
        data: &Dataset,
        run: &Run,
        (states, given): (&[usize], &[Option<usize>]),
        n_train: usize,
        progress: &dyn Progress,
    ) -> Result<(Mat<f64>, Mat<f64>)> {
        let n = states.len();
        let raw = Mat::from_fn(n_train, n, |i, j| run.values[(i, states[j])]);
        // Over the whole record, before the split: the last training row sees one test sample.
        let rate = |(&state, given): (&usize, &Option<usize>)| match given {
            Some(column) => run.column(*column).to_vec(),
            None => slope(&run.time, run.column(state)),
        };
        let slopes: Vec<Vec<f64>> = states.iter().zip(given).map(rate).collect();
        let dx = Mat::from_fn(n_train, n, |i, j| slopes[j][i]);
        let Some(inputs) = &self.inputs else { return Ok((raw, dx)) };
        if inputs.len() != n {
            return Err(Error::shape("inputs", format!("{n} lists, one a state"), inputs.len()));
        }
        let end = run.time[n_train - 1];
        let training = data.filter_samples(|_, t| t <= end)?;
        let smoother = Smoother { kernels: self.kernels.clone(), ..Smoother::default() };
        let mean = smoother.smooth(&training, states, progress)?.runs.remove(0).mean;
        let stage = SecondStage { kernels: self.kernels.clone(), isotropic: true, ..SecondStage::default() };
        let mut denoised = Mat::zeros(n_train, n);
        for (j, names) in inputs.iter().enumerate() {
            let columns: Vec<Vec<f64>> = if names.is_empty() {
                (0..n).map(|k| mean.col_as_slice(k).to_vec()).collect()
            } else {
                let columns = data.indices_of(names)?;
                columns.iter().map(|&c| run.column(c)[..n_train].to_vec()).collect()
            };
            let prediction = stage.predict(&[columns], &[dx.col_as_slice(j).to_vec()])?;
            denoised.col_as_slice_mut(j).copy_from_slice(&prediction.runs[0].0);
        }
        Ok((mean, denoised))
    }

    fn model(&self, library: &Library, lambda: f64, coefficients: Vec<Vec<f64>>) -> Model {
        let state = |(name, c): (&String, &Vec<f64>)| State::new(name, library.equation(c));
        Model {
            name: "identified".into(),
            states: self.states.iter().zip(&coefficients).map(state).collect(),
            controls: self.controls.iter().map(Control::new).collect(),
            identification: Some(IdentificationRecord {
                terms: library.names().iter().map(ToString::to_string).collect(),
                lambda: vec![lambda; coefficients.len()],
                coefficients,
                ..IdentificationRecord::default()
            }),
            ..Model::default()
        }
    }
}

/// Frobenius norm over samples and states of forward Euler from the first noisy sample against the noisy log.
fn euler_error(
    library: &Library,
    coefficients: &[Vec<f64>],
    run: &Run,
    logged: &Mat<f64>,
    (first, end): (usize, usize),
) -> f64 {
    let (n, width) = (coefficients.len(), logged.ncols());
    let mut now = Mat::from_fn(1, width, |_, j| logged[(first, j)]);
    let mut square = 0.0;
    for i in first..end - 1 {
        let Ok(theta) = library.evaluate(now.as_ref(), &run.time[i..=i]) else { return f64::NAN };
        let h = run.time[i + 1] - run.time[i];
        for (j, column) in coefficients.iter().enumerate() {
            let rate: f64 = column.iter().enumerate().map(|(k, c)| c * theta[(0, k)]).sum();
            now[(0, j)] += h * rate;
            square += (now[(0, j)] - logged[(i + 1, j)]).powi(2);
        }
        (n..width).for_each(|j| now[(0, j)] = logged[(i + 1, j)]);
    }
    square.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Channel;
    use crate::progress::Silent;

    /// x' = -x + u by forward Euler itself, so that the pipeline can be exact.
    fn data() -> Dataset {
        let time: Vec<f64> = (0..80).map(|i| 0.1 * i as f64).collect();
        let u = |i: usize| (0.35 * i as f64).sin();
        let mut x = vec![1.0];
        for i in 0..79 {
            x.push(x[i] + 0.1 * (u(i) - x[i]));
        }
        let values = Mat::from_fn(80, 2, |i, j| if j == 0 { x[i] } else { u(i) });
        let channels = vec![Channel::new("x"), Channel::new("u")];
        Dataset::new(channels, vec![Run { name: "a".into(), time, values }]).unwrap()
    }

    fn settings() -> Author {
        Author { states: vec!["x".into()], controls: vec!["u".into()], ..Author::default() }
    }

    #[test]
    fn there_are_25_lambdas_from_a_millionth_to_a_hundred() {
        let all = lambdas();
        assert_eq!((all.len(), all[0], all[5], all[24]), (25, 1e-6, 0.1, 100.0));
    }

    #[test]
    fn both_ways_follow_a_simple_system() {
        // The log spreads by 0.5 over 57 training samples: an error of 1 is a fifth of that norm.
        let plain = settings().fit(&data(), &Silent).unwrap();
        assert!(plain.train_error < 1.0 && plain.test_error < 1.0, "{plain:?}");
        let both = Author { inputs: Some(vec![vec!["x".into(), "u".into()]]), ..settings() };
        assert!(both.fit(&data(), &Silent).unwrap().train_error < 1.5);
    }

    #[test]
    fn given_derivatives_and_a_given_lambda_are_taken() {
        let one = data();
        let run = &one.runs()[0];
        // Exact rates of the discrete system: differences of the log are off, these are not.
        let values =
            Mat::from_fn(
                80,
                3,
                |i, j| if j < 2 { run.values[(i, j)] } else { run.values[(i, 1)] - run.values[(i, 0)] },
            );
        let channels = vec![Channel::new("x"), Channel::new("u"), Channel::new("rate")];
        let with_rate = Dataset::new(channels, vec![Run { values, ..run.clone() }]).unwrap();
        let library = LibrarySettings { degree: 1, ..LibrarySettings::default() };
        let given = Author {
            derivatives: vec![("x".into(), "rate".into())],
            library: library.clone(),
            lambda: Some(1e-4),
            ..settings()
        };
        let found = given.fit(&with_rate, &Silent).unwrap();
        let record = found.model.identification.as_ref().unwrap();
        assert_eq!((found.lambda, record.terms.join(" ")), (1e-4, "1 x u".into()));
        // The two loose digits of their ADMM.
        let off = record.coefficients[0].iter().zip([0.0, -1.0, 1.0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.05, "{record:?}");
        assert!(
            found.test_error < 0.1 * Author { library, ..settings() }.fit(&one, &Silent).unwrap().test_error + 0.05
        );
        let unknown = Author { derivatives: vec![("y".into(), "rate".into())], ..settings() };
        assert!(unknown.fit(&with_rate, &Silent).is_err());
        let negative = Author { lambda: Some(-1.0), ..settings() }.fit(&one, &Silent).unwrap_err().to_string();
        assert!(negative.contains("lambda"), "{negative}");
    }

    #[test]
    fn two_runs_and_missing_values_are_refused() {
        let one = data();
        let two = Dataset::concat(vec![one.clone(), one.clone()]).unwrap();
        assert!(settings().fit(&two, &Silent).unwrap_err().to_string().contains("one run"));
        let mut run = one.runs()[0].clone();
        run.values[(3, 0)] = f64::NAN;
        let broken = Dataset::new(one.channels().to_vec(), vec![run]).unwrap();
        assert!(settings().fit(&broken, &Silent).is_err());
        let text = Author { inputs: Some(vec![]), ..settings() }.fit(&one, &Silent).unwrap_err().to_string();
        assert!(text.contains("one a state"), "{text}");
    }
}
