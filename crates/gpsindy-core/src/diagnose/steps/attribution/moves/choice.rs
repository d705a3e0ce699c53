//! Which moves are worth a fit, by straight lines.

use super::Move;
use crate::diagnose::catalogue::hypothesis::{Combine, Start};
use crate::diagnose::fit::colours::noise::Noise;
use crate::diagnose::fit::contestant::Contestant;
use crate::diagnose::fit::linear::gains::Gain;
use crate::diagnose::limits::{
    CONVINCING, IN_SIGHT, MATERIAL, MOST_PER_EQUATION, OF_FAMILY, OF_PLACE, PROMISING, SHORTLIST, STARTS, SUBSTITUTE,
    SWAPPED, TOGETHER,
};
use crate::diagnose::steps::attribution::contest::Contest;
use crate::diagnose::steps::attribution::survey::{Looked, Pair, Screened, Survey};

/// Whether a straight-line gain is large enough for one more effect to be convincing and material.
fn is_promising(base: &Contestant, gain: f64) -> bool {
    let evidence = &base.evidence;
    // What tolerated parameters have taken up may be this effect's.
    let hidden = evidence.strain > MATERIAL;
    let needed = PROMISING * MATERIAL * evidence.count() as f64 * evidence.misfit().min(1.0);
    gain > CONVINCING && (hidden || gain > needed)
}

/// Whether what comes beside a model that leaves only noise promises half of what would convince: a straight line underrates a curved effect by no
/// more. Beside a rest it may promise too little by far, where readings are trusted more than the model is.
pub(super) fn is_worth_a_fit(contest: &Contest<'_>, base: &Contestant, m: &Move<'_>) -> bool {
    // Two in the place of one may be that one and another.
    let suspect = |&member: &usize| &contest.hypotheses[member];
    let stays = |place: &usize| m.members.iter().map(suspect).any(|h| *h == base.hypotheses[*place]);
    if base.hypotheses.is_empty() || !m.out.iter().all(stays) || base.evidence.leaves_a_rest() {
        return true;
    }
    let price = (base.evidence.count().max(2) as f64).ln();
    let new = m.members.iter().map(suspect).filter(|h| !base.hypotheses.contains(h));
    let needed = 2.0 * CONVINCING + new.map(|h| price - 2.0 * contest.log_prior(h)).sum::<f64>();
    m.promised > SUBSTITUTE * needed
}

/// Whether the equations of the members take that many more effects.
pub(super) fn has_room(contest: &Contest<'_>, base: &Contestant, members: &[usize], out: &[usize]) -> bool {
    let kept = || base.hypotheses.iter().enumerate().filter(|(place, _)| !out.contains(place)).map(|(_, h)| h);
    if kept().count() + members.len() > contest.most {
        return false;
    }
    members.iter().all(|&m| {
        let state = contest.hypotheses[m].state;
        let more = members.iter().filter(|&&h| contest.hypotheses[h].state == state).count();
        let room = kept().filter(|h| h.state == state).count() + more <= MOST_PER_EQUATION;
        // Frictions that only show together are one law of that equation.
        room || (members.len() > 1 && kept().next().is_none())
    })
}

/// What is fitted, by each noise model: the best of all and of every family beside the effects that are there, what promises together
/// what none promises alone, and the best in the place of each effect and of each two.
pub(super) fn chosen<'a>(contest: &Contest<'_>, base: &Contestant, survey: &'a Survey) -> Vec<Move<'a>> {
    let Survey { suspects, looked, .. } = survey;
    let Some(telling) = suspects.iter().flatten().map(Screened::telling).next() else { return Vec::new() };
    let views = |noise: Noise| looked.of(noise).map_or(&[][..], Vec::as_slice);
    let (first, mut wanted) = (telling[0], Vec::new());
    let promise = |s: &Screened| Noise::ALL.iter().map(|&noise| s.best(noise)).fold(0.0, f64::max);
    if suspects.iter().flatten().any(|s| is_promising(base, promise(s))) {
        telling.iter().for_each(|&noise| wanted.extend(more(contest, suspects, noise).into_iter().map(|h| (h, 0))));
    }
    for &noise in telling {
        wanted.extend(instead(suspects, views(noise), noise));
    }
    wanted.sort_unstable();
    wanted.dedup();
    let starts = |(h, view): (usize, usize)| {
        let of = |screened: &'a Screened| {
            let all = screened.applied.starts.iter().zip(&screened.gains);
            let mut order: Vec<(&Start, &Gain)> =
                all.filter_map(|(values, gains)| Some((values, gains.of(first)?.get(view)?))).collect();
            order.sort_by(|a, b| b.1.gain.total_cmp(&a.1.gain));
            let job = |(from, gain): (&Start, &Gain)| Move {
                members: screened.members.clone(),
                out: views(first)[view].places.clone(),
                applied: Some(&screened.applied),
                values: from.shortened(&gain.values),
                promised: gain.gain - views(first)[view].loss,
            };
            // In the place of another effect one start says enough; beside them it is all that there is.
            apart(&order, if view == 0 { STARTS } else { 1 }).into_iter().map(job).collect::<Vec<_>>()
        };
        suspects[h].as_ref().map(of).unwrap_or_default()
    };
    let pair = |pair: &'a Pair| {
        let Pair { members, places, values, gain } = pair;
        let loss = views(first).iter().find(|looked| looked.places == *places).map_or(0.0, |looked| looked.loss);
        let (members, out, values) = (members.to_vec(), places.clone(), vec![values.clone()]);
        Move { members, out, applied: None, values, promised: gain - loss }
    };
    // Two beside all that is there must promise as much as one.
    let is_worth = |pair: &&Pair| !pair.places.is_empty() || is_promising(base, pair.gain);
    wanted.into_iter().flat_map(starts).chain(survey.pairs.iter().filter(is_worth).map(pair)).collect()
}

/// So many of the starts in their `order`, and one that is pointed to among them; of finite steps those first that differ in their size: two of
/// one size that differ in something else besides, as a play's with and without its damper, lead to one end as often as not.
fn apart<'a>(order: &[(&'a Start, &'a Gain)], count: usize) -> Vec<(&'a Start, &'a Gain)> {
    let size = |start: &Start| (start.combine == Combine::Keep).then(|| start.columns[0][0]);
    let is_again = |place: &usize| {
        let own = size(order[*place].0);
        own.is_some() && order[..*place].iter().any(|(start, _)| size(start) == own)
    };
    let (again, first): (Vec<usize>, Vec<usize>) = (0..order.len()).partition(is_again);
    let mut chosen: Vec<(&Start, &Gain)> =
        first.into_iter().chain(again).take(count).map(|place| order[place]).collect();
    let pointed = order.iter().find(|(start, _)| start.is_pointed);
    if let Some(pointed) = pointed.filter(|_| !chosen.iter().any(|(start, _)| start.is_pointed)) {
        chosen.pop();
        chosen.push(*pointed);
    }
    chosen
}

/// The suspects, and the views, that promise most in the place of one or two effects, by one noise model.
fn instead(suspects: &[Option<Screened>], looked: &[Looked], noise: Noise) -> Vec<(usize, usize)> {
    let mut all: Vec<(usize, usize, f64)> = Vec::new();
    for (view, looked) in looked.iter().enumerate().skip(1) {
        // What takes the place of one may be several that only show together; of two, one.
        let is_fit = |members: usize| looked.places.len() == 1 || members == 1;
        let of = |(h, s): (usize, &Option<Screened>)| {
            let gain = s.as_ref().filter(|s| is_fit(s.members.len()))?.best_in(noise, view);
            let promises = gain - looked.loss > -2.0 * IN_SIGHT || gain > SUBSTITUTE * looked.loss;
            promises.then_some((h, view, gain - looked.loss))
        };
        all.extend(suspects.iter().enumerate().filter_map(of));
    }
    all.sort_by(|a, b| b.2.total_cmp(&a.2));
    let mut chosen: Vec<(usize, usize)> = all.iter().take(SWAPPED).map(|a| (a.0, a.1)).collect();
    // Of every place the best two, whatever the others promise.
    for (view, _) in looked.iter().enumerate().skip(1).filter(|(_, looked)| looked.places.len() == 1) {
        chosen.extend(all.iter().filter(|a| a.1 == view).take(OF_PLACE).map(|a| (a.0, a.1)));
    }
    chosen
}

/// The suspects that promise most beside the effects that are there, by one noise model.
fn more(contest: &Contest<'_>, suspects: &[Option<Screened>], noise: Noise) -> Vec<usize> {
    let (alone, joint) = suspects.split_at(contest.hypotheses.len());
    let best = |h: usize| suspects[h].as_ref().map_or(0.0, |s| s.best(noise));
    let mut together: Vec<(usize, f64)> = Vec::new();
    for (place, suspect) in joint.iter().enumerate() {
        let Some(suspect) = suspect else { continue };
        let members = suspect.members.iter().map(|&h| best(h)).fold(0.0, f64::max);
        if suspect.best(noise) > members + CONVINCING {
            together.push((alone.len() + place, suspect.best(noise)));
        }
    }
    together.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut chosen: Vec<usize> = together.iter().take(TOGETHER).map(|t| t.0).collect();
    let mut order: Vec<(usize, f64)> =
        alone.iter().enumerate().filter_map(|(h, s)| Some((h, s.as_ref()?.best(noise)))).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let largest = order.first().map_or(0.0, |o| o.1);
    chosen.extend(order.iter().take(SHORTLIST).filter(|o| o.1 > 0.0).map(|o| o.0));
    let mut families = Vec::new();
    for (h, gain) in order {
        if gain > OF_FAMILY * largest && !families.contains(&contest.hypotheses[h].family()) {
            families.push(contest.hypotheses[h].family());
            chosen.push(h);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_of_another_size_come_before_those_that_differ_in_a_share() {
        let starts = [[0.1, 1.0], [0.1, 0.0], [0.3, 0.0]].map(|values| Start {
            columns: vec![values.into()],
            combine: Combine::Keep,
            amplitudes: Vec::new(),
            is_pointed: false,
        });
        let gain = Gain { gain: 1.0, values: Vec::new(), degrees: 1, deviation: None };
        let order: Vec<(&Start, &Gain)> = starts.iter().map(|start| (start, &gain)).collect();
        let first = |count: usize| -> Vec<&[f64]> {
            apart(&order, count).into_iter().map(|(start, _)| &start.columns[0][..]).collect()
        };
        assert_eq!(first(2), [[0.1, 1.0], [0.3, 0.0]]);
        assert_eq!(first(3), [[0.1, 1.0], [0.3, 0.0], [0.1, 0.0]]);
        let pointed = Start { is_pointed: true, ..starts[1].clone() };
        let order = [(&starts[0], &gain), (&starts[2], &gain), (&pointed, &gain)];
        let values: Vec<&[f64]> = apart(&order, 2).into_iter().map(|(start, _)| &start.columns[0][..]).collect();
        assert_eq!(values, [[0.1, 1.0], [0.1, 0.0]]);
    }
}
