//! Handed over: whether the search fitted the right set of effects, and how far straight lines keep what they promise.

use super::answers::{Answer, Suite};
use super::judge::is_named;
use super::rate::Rate;
use gpsindy_core::diagnose::{Handed, Member};
use serde::Serialize;
use std::collections::BTreeMap;

/// Achieved over promised gain within which a straight line kept its promise: half of it to twice.
const KEPT: (f64, f64) = (0.5, 2.0);

/// What the searches of an exam handed over to fits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HandedOver {
    /// Cases of the catalogue whose true set of effects, by an accepted name each, was fitted.
    pub right_set: Rate,
    /// Fits that came to rest and achieved half to twice of what was promised, of those that promised anything.
    pub kept: Rate,
    /// Spearman's correlation of promised and achieved gains by the family of the effect that was new, best known first.
    pub families: Vec<FamilyRank>,
    /// The cases whose true set was not fitted.
    pub missed: Vec<String>,
}

/// How far the gains of one family keep the order that was promised.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FamilyRank {
    /// The family.
    pub family: String,
    /// Fits that came to rest.
    pub of: usize,
    /// Rank correlation; absent where all are alike.
    pub correlation: Option<f64>,
}

impl HandedOver {
    /// From what was handed over, by id of the case.
    pub fn new(suite: &Suite, handed: &BTreeMap<String, Vec<Handed>>) -> Self {
        let known = || suite.cases.iter().filter(|answer| answer.in_catalogue && !answer.effects.is_empty());
        let is_right = |answer: &Answer| {
            let sets = handed.get(&answer.id).into_iter().flatten();
            sets.filter(|set| set.members.len() == answer.effects.len())
                .any(|set| covers(answer, &set.members, 0, &mut vec![false; set.members.len()]))
        };
        let all = || handed.values().flatten();
        let ratio = |set: &Handed| set.achieved / set.promised;
        let at_rest = all().filter(|set| set.at_rest && set.promised > 0.0);
        let mut families: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
        // A fit that was given up has not shown what it achieves.
        for set in all().filter(|set| set.at_rest) {
            families.entry(set.family.clone()).or_default().push((set.promised, set.achieved));
        }
        let rank = |(family, pairs): (String, Vec<(f64, f64)>)| FamilyRank {
            family,
            of: pairs.len(),
            correlation: rank_correlation(&pairs),
        };
        let mut families: Vec<FamilyRank> = families.into_iter().map(rank).collect();
        families.sort_by_key(|family| std::cmp::Reverse(family.of));
        Self {
            right_set: Rate::count(known().map(is_right)),
            kept: Rate::count(at_rest.map(|set| (KEPT.0..=KEPT.1).contains(&ratio(set)))),
            families,
            missed: known().filter(|answer| !is_right(answer)).map(|answer| answer.id.clone()).collect(),
        }
    }
}

/// Whether the effects of the answer from number `of` on each have a member of their own.
fn covers(answer: &Answer, members: &[Member], of: usize, taken: &mut [bool]) -> bool {
    if of == answer.effects.len() {
        return true;
    }
    for (place, member) in members.iter().enumerate() {
        if !taken[place] && is_named(answer, (&member.effect, &member.state, &member.variables), Some(of)) {
            taken[place] = true;
            if covers(answer, members, of + 1, taken) {
                return true;
            }
            taken[place] = false;
        }
    }
    false
}

/// Spearman's rank correlation, ties at their mean rank; absent where one of the two is constant.
fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let one = ranks(pairs.iter().map(|pair| pair.0));
    let other = ranks(pairs.iter().map(|pair| pair.1));
    let mean = 0.5 * (pairs.len() as f64 - 1.0);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let scale = (product(&one, &one) * product(&other, &other)).sqrt();
    (scale > 0.0).then(|| product(&one, &other) / scale)
}

fn ranks(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let values: Vec<f64> = values.collect();
    let rank = |value: &f64| {
        let below = values.iter().filter(|other| other.total_cmp(value).is_lt()).count();
        let alike = values.iter().filter(|other| other.total_cmp(value).is_eq()).count();
        below as f64 + 0.5 * (alike as f64 - 1.0)
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn ranks_correlate_whatever_the_scale_and_share_their_places_where_values_are_alike() {
        let correlation = |pairs: &[(f64, f64)]| rank_correlation(pairs).unwrap();
        assert!((correlation(&[(1.0, 1.0), (2.0, 100.0), (3.0, 1e6)]) - 1.0).abs() < 1e-12);
        assert!((correlation(&[(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)]) + 1.0).abs() < 1e-12);
        // Kendall and Gibbons 1990, Rank Correlation Methods: with a tie the ranks are 0, 1.5, 1.5, 3.
        assert!((correlation(&[(1.0, 1.0), (2.0, 2.0), (2.0, 3.0), (4.0, 4.0)]) - 0.948_683).abs() < 1e-6);
        assert_eq!(rank_correlation(&[(1.0, 1.0), (1.0, 2.0)]), None);
    }
}
