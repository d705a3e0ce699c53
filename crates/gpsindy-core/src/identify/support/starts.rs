//! Where the search for terms starts.

use crate::identify::algorithm1::regress::{Chosen, Regressed};
use crate::identify::equations::Equations;
use crate::identify::limits::SPARSE;

/// The equations as chosen; what the rows' evidence takes; and sparser ones of the same path. A search that starts too sparse
/// may find no way, one that starts too dense may find no rollout or no way back.
pub(crate) fn starts(Regressed { equations, chosen }: &Regressed) -> Vec<Equations> {
    let from_path = |pick: &dyn Fn(&Chosen) -> Option<usize>| {
        let mut other = equations.clone();
        for (s, chosen) in chosen.iter().enumerate() {
            if let Some(found) = chosen.as_ref().and_then(|c| pick(c).map(|k| &c.path[k])) {
                other.set(s, found);
            }
        }
        other
    };
    let count = |coefficients: &[f64]| coefficients.iter().filter(|c| **c != 0.0).count();
    let largest = (0..equations.n_states()).map(|s| equations.support.terms(s).len()).max().unwrap_or(0);
    let mut starts = vec![equations.clone(), from_path(&|c| c.best)];
    for most in 1..largest.min(SPARSE + 1) {
        starts.push(from_path(&|c| {
            let sparser = (0..c.path.len()).filter(|&k| count(&c.path[k]) <= most.min(count(&c.coefficients)));
            sparser.max_by_key(|&k| count(&c.path[k]))
        }));
    }
    let mut kept: Vec<Equations> = Vec::new();
    for start in starts {
        if kept.iter().all(|other| other.support != start.support) {
            kept.push(start);
        }
    }
    kept
}
