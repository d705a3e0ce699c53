//! Facts, optimality conditions, and agreement with a second solver.

use super::super::testing::random_problem;
use super::*;

fn plain(lambda: f64) -> Lasso {
    Lasso { lambda, scale_columns: false, refit: false, ..Lasso::default() }
}

/// Cyclic coordinate descent on the same objective, written for this comparison only.
fn coordinate_descent(theta: &Mat<f64>, target: &[f64], lambda: f64) -> Vec<f64> {
    let (r, p) = (theta.nrows(), theta.ncols());
    let mut x = vec![0.0; p];
    let mut left = target.to_vec();
    for _ in 0..200_000 {
        let mut largest = 0.0f64;
        for j in 0..p {
            let (mut square, mut correlation) = (0.0, 0.0);
            for i in 0..r {
                square += theta[(i, j)] * theta[(i, j)];
                correlation += theta[(i, j)] * left[i];
            }
            if square == 0.0 {
                continue;
            }
            let new = soft(correlation + square * x[j], lambda) / square;
            let change = new - x[j];
            for i in 0..r {
                left[i] -= change * theta[(i, j)];
            }
            largest = largest.max(change.abs() * square.sqrt());
            x[j] = new;
        }
        if largest < 1e-14 {
            break;
        }
    }
    x
}

fn objective(theta: &Mat<f64>, target: &[f64], lambda: f64, x: &[f64]) -> f64 {
    let r = residual(theta, target, x);
    0.5 * dot(&r, &r) + lambda * x.iter().map(|v| v.abs()).sum::<f64>()
}

#[test]
fn orthonormal_columns_give_soft_thresholding() {
    let theta = Mat::from_fn(4, 3, |i, j| if i == j { 1.0 } else { 0.0 });
    let fit = plain(1.0).fit(theta.as_ref(), &[3.0, -0.5, -2.0, 7.0]).unwrap();
    for (found, truth) in fit.coefficients.iter().zip([2.0, 0.0, -1.0]) {
        assert!((found - truth).abs() < 1e-14, "{found} {truth}");
    }
    assert!(fit.converged && fit.gap < 1e-12);
}

#[test]
fn the_optimality_conditions_hold_on_random_problems() {
    for seed in 0..20 {
        // Tall and fat, columns whose norms differ by 100.
        let (r, p) = if seed % 2 == 0 { (60, 12) } else { (15, 40) };
        let (theta, target) = random_problem(r, p, &[(0, 3.0), (1, -1.0), (5, 0.7)], 0.5, seed);
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let top = problem.lambda_max(false);
        for share in [0.5, 0.1, 0.01] {
            let lambda = share * top;
            let fit = plain(lambda).fit(theta.as_ref(), &target).unwrap();
            assert!(fit.converged, "seed {seed}, lambda {lambda}, gap {}", fit.gap);
            let slopes = transposed_times(&theta, &residual(&theta, &target, &fit.coefficients));
            for (x, slope) in fit.coefficients.iter().zip(slopes) {
                // A gap of 1e-10 bounds the slope to about its square root; the polish is far better.
                if *x == 0.0 {
                    assert!(slope.abs() <= lambda * (1.0 + 1e-6));
                } else {
                    assert!((slope - lambda * x.signum()).abs() <= 1e-6 * lambda.max(top * 1e-3));
                }
            }
        }
    }
}

#[test]
fn coordinate_descent_finds_the_same_optimum() {
    for seed in 20..30 {
        let (theta, target) = random_problem(40, 10, &[(2, 1.0), (7, -3.0)], 0.4, seed);
        let lambda = 0.05 * Reduced::new(theta.as_ref(), &target).unwrap().lambda_max(false);
        let fit = plain(lambda).fit(theta.as_ref(), &target).unwrap();
        let other = coordinate_descent(&theta, &target, lambda);
        let (ours, theirs) =
            (objective(&theta, &target, lambda, &fit.coefficients), objective(&theta, &target, lambda, &other));
        assert!((ours - theirs).abs() < 1e-9 * theirs, "{ours} {theirs}");
        for (x, y) in fit.coefficients.iter().zip(&other) {
            assert!((x - y).abs() < 1e-7 * (1.0 + y.abs()));
        }
    }
}

#[test]
fn a_well_separated_support_comes_back_exactly() {
    for seed in 30..50 {
        let truth = [(1, 2.0), (4, -0.5), (9, 30.0)];
        let (theta, target) = random_problem(100, 15, &truth, 0.01, seed);
        let top = Reduced::new(theta.as_ref(), &target).unwrap().lambda_max(true);
        let fit = Lasso { lambda: 1e-2 * top, ..Lasso::default() }.fit(theta.as_ref(), &target).unwrap();
        assert_eq!(fit.support(), [1, 4, 9], "seed {seed}");
        // Refitted: the error is that of least squares, 0.01 / sqrt(100) / column size, at most 0.01 for size 0.1.
        assert!(truth.iter().all(|&(j, c)| (fit.coefficients[j] - c).abs() < 0.06));
    }
}

#[test]
fn above_lambda_max_nothing_is_left_and_below_it_something() {
    let (theta, target) = random_problem(30, 6, &[(3, 1.0)], 0.1, 7);
    for scale_columns in [false, true] {
        let top = Reduced::new(theta.as_ref(), &target).unwrap().lambda_max(scale_columns);
        let terms = |lambda| {
            Lasso { lambda, scale_columns, ..Lasso::default() }.fit(theta.as_ref(), &target).unwrap().n_terms()
        };
        assert_eq!(terms(top * 1.0001), 0);
        assert_eq!(terms(top * 0.999), 1);
    }
}

#[test]
fn scaling_makes_the_answer_independent_of_units() {
    let (theta, target) = random_problem(40, 5, &[(0, 1.0), (1, 2.0)], 0.2, 8);
    let other = Mat::from_fn(40, 5, |i, j| theta[(i, j)] * 1000f64.powi(j as i32 - 2));
    let one = Lasso { lambda: 0.5, ..Lasso::default() }.fit(theta.as_ref(), &target).unwrap();
    let two = Lasso { lambda: 0.5, ..Lasso::default() }.fit(other.as_ref(), &target).unwrap();
    for j in 0..5 {
        let back = two.coefficients[j] * 1000f64.powi(j as i32 - 2);
        assert!((one.coefficients[j] - back).abs() < 1e-9 * (1.0 + back.abs()));
    }
}

#[test]
fn a_path_with_warm_starts_equals_cold_fits_that_end() {
    // More rows than terms, and fewer.
    for (rows, terms) in [(50, 20), (15, 40)] {
        let (theta, target) = random_problem(rows, terms, &[(0, 1.0), (4, 2.0), (8, -1.0)], 0.3, 9);
        let problem = Reduced::new(theta.as_ref(), &target).unwrap();
        let method = plain(0.0);
        let levels = method.levels(&problem, 20);
        assert_eq!(levels.len(), 20);
        for (fit, &lambda) in method.path(&problem, &levels).unwrap().iter().zip(&levels) {
            let cold = plain(lambda).fit(theta.as_ref(), &target).unwrap();
            let (a, b) = (
                objective(&theta, &target, lambda, &fit.coefficients),
                objective(&theta, &target, lambda, &cold.coefficients),
            );
            if rows > terms {
                assert!((a - b).abs() <= 1e-9 * b, "lambda {lambda}: {a} {b}");
                continue;
            }
            // A gap of 1e-10 of half the squared target may be left of each, and the cold fit may stop short.
            let left = 1e-10 * dot(&target, &target);
            assert!(fit.converged && a <= b + left, "lambda {lambda}: {a} {b}");
            assert!(!cold.converged || b <= a + left, "lambda {lambda}: {a} {b}");
        }
    }
}

#[test]
fn a_path_that_ends_in_rounding_gives_up() {
    // No gap is small enough.
    let (theta, target) = random_problem(12, 20, &[(3, 1.0)], 0.5, 11);
    let problem = Reduced::new(theta.as_ref(), &target).unwrap();
    let method = Lasso { max_iterations: 50, gap_tolerance: Some(0.0), ..plain(0.0) };
    let fits = method.path(&problem, &method.levels(&problem, 60)).unwrap();
    let failed = fits.iter().filter(|f| !f.converged);
    assert!(failed.clone().count() > 30);
    let iterations: usize = failed.map(|f| f.iterations).sum();
    assert!(iterations <= 200, "{iterations}");
    assert_eq!(fits[59].coefficients, fits[58].coefficients);
}

#[test]
fn degenerate_input_gives_a_plain_answer() {
    let fit = |theta: &Mat<f64>, target: &[f64]| plain(0.1).fit(theta.as_ref(), target).unwrap();
    let zero_column = Mat::from_fn(6, 2, |i, j| if j == 0 { 0.0 } else { i as f64 });
    let target = [0.0, 2.0, 4.0, 6.0, 8.0, 10.0];
    assert_eq!(fit(&zero_column, &target).support(), [1]);
    let duplicate = Mat::from_fn(6, 2, |i, _| i as f64);
    let both = fit(&duplicate, &target);
    assert!((both.coefficients[0] + both.coefficients[1] - (2.0 - 0.1 / 55.0)).abs() < 1e-5);
    assert_eq!(fit(&duplicate, &[0.0; 6]).n_terms(), 0);
    assert_eq!(fit(&Mat::zeros(6, 3), &target).n_terms(), 0);
    let refitted = Lasso { lambda: 0.1, ..Lasso::default() }.fit(duplicate.as_ref(), &target).unwrap();
    assert_eq!(refitted.n_terms(), 1);
    assert!(plain(0.1).fit(duplicate.as_ref(), &[f64::NAN; 6]).is_err());
}

#[test]
fn settings_out_of_range_are_named() {
    let (theta, target) = random_problem(10, 2, &[(0, 1.0)], 0.1, 1);
    let text = |lasso: Lasso| lasso.fit(theta.as_ref(), &target).unwrap_err().to_string();
    assert!(text(plain(-0.1)).contains("`lambda` must be at least 0"));
    assert!(text(Lasso { relaxation: 2.0, ..plain(0.1) }).contains("relaxation"));
    assert!(text(Lasso { rho: 0.0, ..plain(0.1) }).contains("rho"));
}

#[test]
fn the_authors_settings_stop_early_near_the_optimum() {
    let (theta, target) = random_problem(60, 8, &[(0, 1.0), (3, -2.0)], 0.3, 11);
    let exact = plain(1.0).fit(theta.as_ref(), &target).unwrap();
    let author = Lasso::author(1.0).fit(theta.as_ref(), &target).unwrap();
    assert!(author.iterations < 1000);
    assert!(author.gap > exact.gap);
    let ratio =
        objective(&theta, &target, 1.0, &author.coefficients) / objective(&theta, &target, 1.0, &exact.coefficients);
    assert!((1.0..1.1).contains(&ratio), "{ratio}");
}

#[test]
fn scikit_learn_finds_the_same_optimum() {
    // scikit-learn 1.9.1, Lasso(alpha=lambda/r, fit_intercept=False, tol=1e-14, max_iter=1000000).fit(A, b) with
    //   i = np.arange(24)[:, None]; j = np.arange(5)[None, :]; A = np.sin(0.7*(i+1)*(j+1)) + 0.2*j
    //   b = 2*A[:, 0] - A[:, 3] + 0.3*np.cos(1.9*np.arange(24))
    let theta = Mat::from_fn(24, 5, |i, j| (0.7 * ((i + 1) * (j + 1)) as f64).sin() + 0.2 * j as f64);
    let target: Vec<f64> =
        (0..24).map(|i| 2.0 * theta[(i, 0)] - theta[(i, 3)] + 0.3 * (1.9 * i as f64).cos()).collect();
    let recorded = [
        (0.5, [1.94788020861, 0.0, -0.0250097206733, -0.968750258248, 0.00479950307514], 2.036985016678405),
        (5.0, [1.54913012373, 0.0, 0.0, -0.73482896688, 0.0], 13.753696630790957),
    ];
    for (lambda, coefficients, value) in recorded {
        let fit = plain(lambda).fit(theta.as_ref(), &target).unwrap();
        // Their tolerance and 12 printed digits leave 1e-10 or so.
        assert!(fit.coefficients.iter().zip(coefficients).all(|(x, y)| (x - y).abs() < 1e-9), "{fit:?}");
        assert!((objective(&theta, &target, lambda, &fit.coefficients) - value).abs() < 1e-10);
    }
}
