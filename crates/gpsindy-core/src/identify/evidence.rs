//! The evidence of a set of equations, and the penalty of a term.
//!
//! Evidence: `sum_c n_c ln(rss_c / n_c) + sum_j (ln n + 2 ln p + 2 ln(a) (s_j - 1))`, n values, p candidate terms, s_j factors in
//! term j ([`crate::library::Term::complexity`]) and a symbols to write a factor with, one a variable and one for the end: the
//! length of the term's description. Of two indistinguishable terms, the simpler one is kept.
//!
//! Source: Chen and Chen 2008, Extended Bayesian information criteria.

use crate::identify::equations::Equations;
use crate::identify::limits::{CORRELATED, LEAST_SHARE};

/// What term `j` must bring where `n` values are compared.
pub(crate) fn price(equations: &Equations, j: usize, n: f64) -> f64 {
    let complexity = equations.library.terms()[j].complexity() as f64;
    let symbols = (equations.states.len() + equations.controls.len() + 1) as f64;
    let candidates = equations.n_candidates().max(1) as f64;
    n.max(2.0).ln() + 2.0 * candidates.ln() + 2.0 * symbols.ln() * (complexity - 1.0)
}

/// `(1 - rho) / (1 + rho)` with rho the lag-one autocorrelation of the residuals, between 0.02 and 1.
///
/// Where the model is not the truth its residuals are slow, and n of them are worth fewer than n.
pub(crate) fn independent_share(residuals: &[Vec<f64>], columns: usize) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for window in residuals {
        for (now, next) in window.iter().zip(window.iter().skip(columns)) {
            if now.is_finite() && next.is_finite() {
                product += now * next;
                square += 0.5 * (now * now + next * next);
            }
        }
    }
    let rho = if square > 0.0 { (product / square).clamp(0.0, CORRELATED) } else { 0.0 };
    ((1.0 - rho) / (1.0 + rho)).max(LEAST_SHARE)
}
