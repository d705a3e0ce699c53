//! The second look at the equations, through the integrator: short rollouts first, since a wrong equation stays near the logs
//! in them; then as long as they stay on course, because long ones tell more.

use crate::error::{Error, Result};
use crate::identify::algorithm1::regress::Chosen;
use crate::identify::algorithm1::timing::Timing;
use crate::identify::prepare::Plan;
use crate::identify::support::equations::Equations;
use crate::identify::support::search::{Search, Trial};
use crate::parallel::*;
use crate::progress::{Progress, step};
use crate::refine::Hold;

/// Starts whose supports are improved, those of the best evidence after their first fit.
const LOOKS: usize = 2;

/// Largest number of terms of an equation in the sparser starts.
const SPARSE: usize = 5;

/// Growth of the residual up to which longer rollouts count as being on course.
const ON_COURSE: f64 = 1.3;

/// Growth of the residual up to which longer rollouts tell nothing new about the terms.
const UNCHANGED: f64 = 1.01;

/// Evidence by which interpolated controls must lead: odds of 20. A computer that steers holds what it has sent.
const INTERPOLATED: f64 = 6.0;

/// Largest growth of a small difference along a rollout. Derivatives are taken over a millionth of a state's size: what grows
/// by more than that leaves the straight part, and the fit stands still far from the optimum, sure of itself.
const GROWTH: f64 = 1e6;

/// Rollouts that other equations are looked for with, as shares of the shortest ones.
const SHARES: [f64; 4] = [0.5, 0.75, 1.5, 2.0];

/// What the second look found.
pub(crate) struct Refinement {
    pub(crate) trial: Trial,
    /// Length of the last rollouts, s.
    pub(crate) window: f64,
    pub(crate) hold: Hold,
    /// The same equations under the other hold, with their lead.
    pub(crate) rival: Option<(Trial, f64)>,
}

/// What the second look looks at.
pub(crate) struct SecondLook<'a> {
    /// Length of the rollouts where it is given, s.
    pub(crate) window: Option<f64>,
    pub(crate) plan: &'a Plan,
    pub(crate) timings: &'a [Timing],
    pub(crate) progress: &'a dyn Progress,
}

impl SecondLook<'_> {
    pub(crate) fn refine(&self, starts: &[Equations], notes: &mut Vec<String>) -> Result<Option<Refinement>> {
        let mut found = match self.found(starts)? {
            Ok(found) => found,
            Err(error) => {
                notes.push(format!("no refinement through the integrator: {error}"));
                return Ok(None);
            }
        };
        if self.approximate(&found)? {
            found = self.agreed(found, starts, notes)?;
        }
        if !found.trial.converged {
            notes.push("the refinement stopped before it came to rest".into());
        }
        let search = self.plan.search(found.hold);
        let twice = 2.0 * found.window;
        if found.window < self.plan.longest_run() && explodes(&search, &found.trial, found.window, twice)? {
            notes.push(format!(
                "small differences grow a million times within {twice:.3} s: the motion is unstable or chaotic, and a rollout as long as the logs says little about the equations"
            ));
        }
        search.weigh_choice(&mut found.trial, found.window)?;
        if let Some((rival, lead)) = found.rival.take() {
            found.trial.allow_for(&rival, (0.5 * lead).exp().min(1.0));
        }
        Ok(Some(found))
    }

    /// The equations of the best evidence, or why there are none.
    fn found(&self, starts: &[Equations]) -> Result<std::result::Result<Refinement, Error>> {
        let shortest = self.window.unwrap_or_else(|| self.plan.shortest_window());
        let (trial, hold) = match self.first_look(starts, shortest)? {
            Ok(found) => found,
            Err(error) => return Ok(Err(error)),
        };
        let (trial, window) = self.lengthened(&self.plan.search(hold), trial, shortest)?;
        self.other_hold(Refinement { trial, window, hold, rival: None }, shortest).map(Ok)
    }

    /// Whether the equations are approximations of a controlled motion: long rollouts leave the logs by more than the noise.
    fn approximate(&self, found: &Refinement) -> Result<bool> {
        let controlled = !found.trial.equations.controls.is_empty();
        Ok(controlled && self.window.is_none() && self.plan.off_course(found)?)
    }

    /// Of `found`, the equations that rollouts of other lengths lead to, and all of them fitted to longer rollouts, those that
    /// stay near the logs and agree best with the others.
    fn agreed(&self, found: Refinement, starts: &[Equations], notes: &mut Vec<String>) -> Result<Refinement> {
        let shortest = self.plan.shortest_window();
        let look = |share: &f64| SecondLook { window: Some(share * shortest), ..*self }.found(starts);
        let others = SHARES.par_iter().map(look).collect::<Result<Vec<_>>>()?;
        let mut members = vec![found];
        for other in others.into_iter().flatten() {
            let support = other.trial.equations.support();
            if members.iter().all(|member| member.trial.equations.support() != support) {
                members.push(other);
            }
        }
        let longer = members.par_iter().map(|member| self.longer(member)).collect::<Result<Vec<_>>>()?;
        members.extend(longer.into_iter().flatten());
        let place = if members.len() > 2 { self.plan.consensus(&members)? } else { 0 };
        if place > 0 {
            notes.push(format!(
                "the equations are an approximation: of {} the ones were taken that stay near the logs in long rollouts and agree best with the others when the controls of one stretch meet the states of another; the evidence of short rollouts alone is for others",
                members.len()
            ));
        }
        Ok(members.swap_remove(place))
    }

    /// The same terms fitted to longer and longer rollouts, on course or not: short ones with free starts hide where an
    /// approximation leads in the end.
    fn longer(&self, member: &Refinement) -> Result<Vec<Refinement>> {
        let search = self.plan.search(member.hold);
        let whole = self.plan.longest_run();
        let (mut near, mut window) = (member.trial.clone(), member.window);
        let mut found = Vec::new();
        while window < whole {
            self.keep_going()()?;
            let longer = (2.0 * window).min(whole);
            if explodes(&search, &near, window, longer)? {
                break;
            }
            window = longer;
            near = match search.fit(&near.equations, window, Some(&near)) {
                Ok(trial) => trial,
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(_) => break,
            };
            found.push(Refinement { trial: near.clone(), window, hold: member.hold, rival: None });
        }
        Ok(found)
    }

    /// The hold that explains long rollouts, since short ones hardly tell one from the other; and the equations under the other
    /// one, with their lead.
    ///
    /// The rival starts from the short rollouts as well: where motions are chaotic, no fit finds from the long ones of one hold
    /// to those of the other.
    fn other_hold(&self, found: Refinement, shortest: f64) -> Result<Refinement> {
        let Some(other) = self.timings.iter().find(|timing| timing.hold != found.hold) else {
            return Ok(found);
        };
        let search = self.plan.search(other.hold);
        let equations = Equations { delays: other.delays.clone(), ..found.trial.equations.clone() };
        let rival = match search.fit(&equations, shortest, None) {
            Ok(rival) => rival,
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(_) => return Ok(found),
        };
        let (rival, window) = self.lengthened(&search, rival, shortest)?;
        // Longer rollouts leave more, so that only equal ones compare.
        if window != found.window {
            return Ok(found);
        }
        let lead = search.lead(&rival, &found.trial);
        if lead < if other.hold == Hold::Linear { INTERPOLATED } else { -INTERPOLATED } {
            return Ok(Refinement { rival: Some((rival, lead)), ..found });
        }
        Ok(Refinement { trial: rival, window, hold: other.hold, rival: Some((found.trial, -lead)) })
    }

    fn keep_going(&self) -> impl Fn() -> Result<()> {
        || step(self.progress, "refine", 0, 1)
    }

    /// The first fits and their better supports, from every start, with held and with interpolated controls where the rows
    /// left that open; the one of the best evidence, or why there is none.
    fn first_look(&self, starts: &[Equations], window: f64) -> Result<std::result::Result<(Trial, Hold), Error>> {
        let likely = self.timings.iter().filter(|timing| !timing.unlikely);
        let pairs: Vec<(&Timing, &Equations)> =
            likely.flat_map(|timing| starts.iter().map(move |start| (timing, start))).collect();
        let fit = |&(timing, start): &(&Timing, &Equations)| {
            let equations = Equations { delays: timing.delays.clone(), ..start.clone() };
            (timing.hold, self.plan.search(timing.hold).fit(&equations, window, None))
        };
        let (mut fitted, mut failure) = (Vec::new(), None);
        for (hold, fit) in pairs.par_iter().map(fit).collect::<Vec<_>>() {
            match fit {
                Ok(trial) => fitted.push((trial, hold)),
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(error) => failure = Some(error),
            }
        }
        self.keep_going()()?;
        let rank = self.plan.search(Hold::Zero).ranked(fitted.iter().map(|(trial, _)| trial));
        let mut best: Option<(Trial, Hold)> = None;
        for (trial, hold) in rank.into_iter().take(LOOKS).map(|k| fitted[k].clone()) {
            let search = self.plan.search(hold);
            let trial = search.improve(trial, window, &self.keep_going())?;
            // A tie keeps what led before.
            if best.as_ref().is_none_or(|(other, _)| search.lead(&trial, other) > 2.0) {
                best = Some((trial, hold));
            }
        }
        let nothing = || Error::invalid("no start of the search");
        Ok(best.ok_or_else(|| failure.unwrap_or_else(nothing)))
    }

    /// Longer and longer rollouts while they stay on course, the terms looked at again wherever they tell something new.
    fn lengthened(&self, search: &Search<'_>, trial: Trial, window: f64) -> Result<(Trial, f64)> {
        let (mut best, mut window) = (trial, window);
        if self.window.is_some() {
            return Ok((best, window));
        }
        let keep_going = self.keep_going();
        let whole = self.plan.longest_run();
        // Whether the terms were looked at since the rollouts last grew.
        let mut fresh = true;
        while window < whole {
            keep_going()?;
            let longer = (2.0 * window).min(whole);
            if explodes(search, &best, window, longer)? {
                break;
            }
            match search.fit(&best.equations, longer, Some(&best)) {
                Ok(trial) if growth(&best, &trial) <= ON_COURSE => {
                    fresh = false;
                    let unchanged = growth(&best, &trial) <= UNCHANGED;
                    (best, window) = (trial, longer);
                    if unchanged {
                        continue;
                    }
                }
                _ if fresh => break,
                // The terms of shorter rollouts may be too few for longer ones.
                _ => {}
            }
            best = search.improve(best, window, &keep_going)?;
            fresh = true;
        }
        if !fresh {
            best = search.improve(best, window, &keep_going)?;
        }
        Ok((best, window))
    }
}

/// Whether small differences would outgrow their derivatives in rollouts of `longer` seconds: what grows by a in `window`
/// seconds grows by a^2 in twice as many.
fn explodes(search: &Search<'_>, trial: &Trial, window: f64, longer: f64) -> Result<bool> {
    Ok(search.amplification(trial, window)?.powf(longer / window) > GROWTH)
}

/// Where the search starts: the equations as chosen; what the rows' evidence takes; and sparser ones of the same path. A
/// search that starts too sparse may find no way, one that starts too dense may find no rollout or no way back.
pub(crate) fn starts(equations: &Equations, chosen: &[Option<Chosen>]) -> Vec<Equations> {
    let from_path = |pick: &dyn Fn(&Chosen) -> Option<usize>| {
        let mut other = equations.clone();
        for (own, chosen) in other.coefficients.iter_mut().zip(chosen) {
            if let Some(found) = chosen.as_ref().and_then(|c| pick(c).map(|k| &c.path[k])) {
                own.clone_from(found);
            }
        }
        other
    };
    let count = |coefficients: &[f64]| coefficients.iter().filter(|c| **c != 0.0).count();
    let largest = equations.coefficients.iter().map(|own| count(own)).max().unwrap_or(0);
    let mut starts = vec![equations.clone(), from_path(&|c| c.best)];
    for most in 1..largest.min(SPARSE + 1) {
        starts.push(from_path(&|c| {
            let sparser = (0..c.path.len()).filter(|&k| count(&c.path[k]) <= most.min(count(&c.coefficients)));
            sparser.max_by_key(|&k| count(&c.path[k]))
        }));
    }
    let mut kept: Vec<Equations> = Vec::new();
    for start in starts {
        if kept.iter().all(|other| other.support() != start.support()) {
            kept.push(start);
        }
    }
    kept
}

/// By how much the residual of a column grows with longer rollouts, at most.
fn growth(short: &Trial, long: &Trial) -> f64 {
    short.noise.iter().zip(&long.noise).map(|(short, long)| long / short).fold(0.0, f64::max)
}
