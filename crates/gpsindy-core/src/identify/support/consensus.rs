//! Consensus: of several equations that explain a log about equally well, selects those that predict long rollouts best and
//! agree most with the others outside the logged data.
//!
//! Short rollouts with free initial states are a weak test of the long-term behaviour of an approximation; long rollouts from
//! the smoothed states are a strong one. Under feedback, every control follows the states, and a relation of the loop (a speed
//! that depends on the place where the car always slows down) can pass for an equation. Such relations fail, each in its own
//! way, when the controls of one part of the log are combined with the states of another, while equations near the truth
//! still predict the same motion.
//!
//! Source for the loop: Ljung 1999, System Identification, section 13.4; for equations judged by their long rollouts: Piroddi and
//! Spinelli 2003, An identification algorithm for polynomial NARX models based on simulation error minimization.

use crate::data::{Channel, Run};
use crate::error::{Result, unless_cancelled};
use crate::identify::algorithm1::smooth::Motion;
use crate::identify::equations::Equations;
use crate::identify::limits::consensus::{APART, FOLLOWED, LEAD, LENGTH, OFF, SHARES, STRETCHES};
use crate::identify::notes::Note;
use crate::identify::support::scope::{Member, Rollouts, Scope};
use crate::model::System;
use crate::parallel;
use crate::simulate::{Excitation, Method, Simulate};
use faer::Mat;

/// A rollout's states by samples in units of their spread; none where it diverged.
type Path = Option<Vec<f64>>;

/// A part of a run.
#[derive(Clone, Copy)]
struct Stretch {
    run: usize,
    first: usize,
    length: usize,
}

/// What equations do from the smoothed start of every stretch: under its own controls, and under those of every other.
struct Paths {
    own: Vec<Path>,
    exchanged: Vec<Path>,
}

impl Scope<'_> {
    /// Whether the equations are approximations of a controlled motion: long rollouts leave the logs by more than the noise.
    pub(crate) fn needs_consensus(&self, found: &Member) -> Result<bool> {
        let controlled = !found.trial.equations.controls.is_empty();
        let is_wanted = self.settings.consensus && self.settings.window.is_none();
        Ok(controlled && is_wanted && Vote(self.motion).off_course(found)? && !self.is_unforeseeable(found)?)
    }

    /// Of `found`, the equations that rollouts of other lengths lead to, and all of them fitted to longer rollouts, those that
    /// stay near the logs and agree best with the others.
    pub(crate) fn agree(&self, found: Member, starts: &[Equations], notes: &mut Vec<Note>) -> Result<Member> {
        let shortest = self.motion.shortest_window();
        let held = self.timings.of(found.hold);
        let mut alone: Scope<'_> = *self;
        alone.timings = &held;
        let search = |share: &f64| alone.search(starts, Rollouts::Fixed(share * shortest));
        let others = parallel::try_map(&SHARES, search)?;
        let mut members = vec![found];
        for other in others.into_iter().flatten() {
            let support = &other.trial.equations.support;
            if members.iter().all(|member| member.trial.equations.support != *support) {
                members.push(other);
            }
        }
        let longer = parallel::try_map(&members, |member| self.with_longer_rollouts(member))?;
        members.extend(longer.into_iter().flatten());
        let place = if members.len() > 2 { Vote(self.motion).consensus(&members)? } else { 0 };
        if place > 0 {
            notes.push(Note::Consensus { members: members.len() });
        }
        Ok(members.swap_remove(place))
    }
}

/// The motion that members are compared on.
#[derive(Clone, Copy)]
struct Vote<'a>(&'a Motion);

impl Vote<'_> {
    /// Whether long rollouts of `member` leave the logs by more than the noise, and by more than a reader would see.
    fn off_course(&self, member: &Member) -> Result<bool> {
        let (spread, stretches) = (self.spreads(), self.stretches());
        let roller = Roller::new(self.0, member, &spread)?;
        let unit: Vec<f64> = member
            .trial
            .noise
            .iter()
            .zip(&spread)
            .map(|(noise, spread)| (OFF * noise / spread).max(FOLLOWED))
            .collect();
        let mut squares = 0.0;
        for &stretch in &stretches {
            let log = self.log(stretch, &spread);
            squares += roller.path(stretch, &roller.excitation(stretch)?)?.map_or(f64::INFINITY, |path| {
                let off = |i: usize| (path[i] - log[i]) / unit[i % spread.len()];
                (0..log.len()).map(|i| off(i).powi(2)).sum::<f64>() / log.len() as f64
            });
        }
        Ok(squares > stretches.len() as f64)
    }

    /// Place of the member of the smallest `course^2 + apart^2`, its distance from the logs in long rollouts and its mean
    /// distance from the other members under exchanged controls, in units of the spread; the first where none leads clearly.
    fn consensus(&self, members: &[Member]) -> Result<usize> {
        let (spread, stretches) = (self.spreads(), self.stretches());
        if stretches.len() < 2 {
            return Ok(0);
        }
        let logs: Vec<Path> = stretches.iter().map(|&stretch| Some(self.log(stretch, &spread))).collect();
        let paths = parallel::try_map(members, |member| self.paths(member, &stretches, &spread))?;
        let score = |k: usize| {
            let others = paths.iter().enumerate().filter(|(other, _)| *other != k).map(|(_, other)| other);
            let total: f64 = others.map(|other| apart(&paths[k].exchanged, &other.exchanged)).sum();
            apart(&paths[k].own, &logs).powi(2) + (total / (paths.len() - 1).max(1) as f64).powi(2)
        };
        let scores: Vec<f64> = (0..members.len()).map(score).collect();
        let best = (0..members.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
        Ok(if scores[best] < LEAD * scores[0] { best } else { 0 })
    }

    /// Spread of every state; of one that does not move the smallest there is, so that whatever moves it is apart.
    fn spreads(&self) -> Vec<f64> {
        self.0.spread.iter().map(|spread| spread.max(f64::MIN_POSITIVE)).collect()
    }

    /// Stretches of equal length, spread over the logs.
    fn stretches(&self) -> Vec<Stretch> {
        let count = |k: usize| self.0.tracks[k].n_samples();
        let longest = (0..self.0.tracks.len()).map(count).max().unwrap_or(0);
        let length = ((LENGTH * longest as f64) as usize).max(2);
        let long: Vec<usize> = (0..self.0.tracks.len()).filter(|&k| count(k) > length).collect();
        let place = |k: usize| {
            let run = long[k * long.len() / STRETCHES];
            let own: Vec<usize> = (0..STRETCHES).filter(|&k| long[k * long.len() / STRETCHES] == run).collect();
            let before = own.iter().filter(|&&other| other < k).count();
            Stretch { run, first: before * (count(run) - length - 1) / (own.len() - 1).max(1), length }
        };
        if long.is_empty() { Vec::new() } else { (0..STRETCHES).map(place).collect() }
    }

    fn paths(&self, member: &Member, stretches: &[Stretch], spread: &[f64]) -> Result<Paths> {
        let roller = Roller::new(self.0, member, spread)?;
        let excitations = stretches.iter().map(|&stretch| roller.excitation(stretch)).collect::<Result<Vec<_>>>()?;
        let mut paths = Paths { own: Vec::new(), exchanged: Vec::new() };
        for (a, &start) in stretches.iter().enumerate() {
            for (b, excitation) in excitations.iter().enumerate() {
                let path = roller.path(start, excitation)?;
                if a == b { paths.own.push(path) } else { paths.exchanged.push(path) }
            }
        }
        Ok(paths)
    }

    /// The smoothed log of a stretch.
    fn log(&self, stretch: Stretch, spread: &[f64]) -> Vec<f64> {
        in_spreads(&self.0.tracks[stretch.run].mean, stretch.first, stretch.length, spread)
    }
}

/// Rolls the equations of one member out.
struct Roller<'a> {
    motion: &'a Motion,
    system: System,
    controls: Vec<Channel>,
    simulate: Simulate,
    spread: &'a [f64],
}

impl<'a> Roller<'a> {
    fn new(motion: &'a Motion, member: &Member, spread: &'a [f64]) -> Result<Self> {
        let equations = &member.trial.equations;
        let system = equations.model().compile()?;
        let controls = equations.controls.iter().map(|(name, _)| Channel::new(name)).collect();
        // The steps of the fits: an approximation may lead to where accurate ones would never end.
        let method = Method::RungeKutta4 { substeps: motion.substeps() };
        Ok(Self {
            motion,
            system,
            controls,
            simulate: Simulate { hold: member.hold, method, ..Simulate::default() },
            spread,
        })
    }

    /// The controls of a stretch.
    fn excitation(&self, Stretch { run, first, length }: Stretch) -> Result<Excitation> {
        let track = &self.motion.tracks[run];
        let run = Run {
            name: "exchanged".into(),
            time: track.time[first..first + length].to_vec(),
            values: Mat::from_fn(length, self.controls.len(), |i, k| track.controls[(first + i, k)]),
        };
        Excitation::of_run(&self.system, &run, &self.controls, self.simulate.hold)
    }

    /// The rollout from the smoothed start of a stretch under these controls.
    fn path(&self, start: Stretch, excitation: &Excitation) -> Result<Path> {
        let mean = &self.motion.tracks[start.run].mean;
        let initial: Vec<f64> = (0..self.spread.len()).map(|s| mean[(start.first, s)]).collect();
        let rollout = unless_cancelled(self.simulate.rollout(&self.system, excitation, &initial))?;
        Ok(rollout.map(|rollout| in_spreads(&rollout.states, 0, start.length, self.spread)))
    }
}

/// Rows of `states` by samples, in units of the spread.
fn in_spreads(states: &Mat<f64>, first: usize, length: usize, spread: &[f64]) -> Vec<f64> {
    let row = |i: usize| spread.iter().enumerate().map(move |(s, spread)| states[(i, s)] / spread);
    (first..first + length).flat_map(row).collect()
}

/// Root mean square difference of rollouts in units of the spread, none beyond [`APART`], as a mean over the rollouts.
fn apart(own: &[Path], other: &[Path]) -> f64 {
    let pair = |(own, other): (&Path, &Path)| match (own, other) {
        (Some(own), Some(other)) => {
            let squares = own.iter().zip(other).map(|(a, b)| (a - b).abs().min(APART).powi(2));
            (squares.sum::<f64>() / own.len().max(1) as f64).sqrt()
        }
        _ => APART,
    };
    own.iter().zip(other).map(pair).sum::<f64>() / own.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Dataset;
    use crate::identify::algorithm1::smooth::smooth;
    use crate::identify::prepare::prepare;
    use crate::identify::settings::Identify;
    use crate::identify::support::fit::Fitter;
    use crate::library::LibrarySettings;
    use crate::progress::Silent;
    use crate::refine::Hold;

    /// Members with these terms, fitted to a log of x' = u - x whose control keeps x on a path that climbs, so that its mean
    /// slope passes for an equation.
    fn members(terms: &[&[&str]]) -> (Motion, Vec<Member>) {
        let time: Vec<f64> = (0..121).map(|i| 0.1 * i as f64).collect();
        let x = |t: f64| t + t.sin() + t.cos();
        let control = |t: f64| 1.0 + t.cos() - t.sin() + x(t);
        let values = Mat::from_fn(121, 2, |i, j| if j == 0 { x(time[i]) } else { control(time[i]) });
        let run = Run { name: "a".into(), time, values };
        let data = Dataset::new(vec![Channel::new("x"), Channel::new("u")], vec![run]).unwrap();
        let identify = Identify {
            states: vec!["x".into()],
            controls: vec!["u".into()],
            library: LibrarySettings { degree: 1, ..LibrarySettings::default() },
            smoother: None,
            ..Identify::default()
        };
        let logs = prepare(&identify, &data, &Silent).unwrap();
        let motion = smooth(&identify, &logs, &Silent).unwrap();
        let fitter = Fitter::new(&logs, &motion, Hold::Linear);
        let member = |terms: &&[&str]| {
            let mut equations = logs.frame.clone();
            let mut coefficients = vec![0.0; equations.n_terms()];
            for term in *terms {
                coefficients[equations.library.index_of(term).unwrap()] = 0.5;
            }
            equations.set(0, &coefficients);
            let trial = fitter.fit(&equations, 12.0, None).unwrap();
            Member { trial, window: 12.0, hold: Hold::Linear, rival: None }
        };
        let members = terms.iter().map(member).collect();
        (motion, members)
    }

    #[test]
    fn a_relation_of_the_loop_is_outvoted_by_equations_that_know_the_control() {
        // The mean slope alone, the truth, and the truth with a constant too many.
        let (motion, members) = members(&[&["1"], &["x", "u"], &["1", "x", "u"]]);
        assert_ne!(Vote(&motion).consensus(&members).unwrap(), 0);
    }

    #[test]
    fn the_evidence_stands_where_no_member_leads_clearly() {
        for terms in [[&["x", "u"][..], &["1", "x", "u"]], [&["1", "x", "u"], &["x", "u"]]] {
            let (motion, members) = members(&[terms[0], terms[1], terms[0]]);
            assert_eq!(Vote(&motion).consensus(&members).unwrap(), 0);
        }
    }

    #[test]
    fn long_rollouts_tell_an_approximation_from_the_truth() {
        let (motion, mut members) = members(&[&["1"], &["x", "u"]]);
        // The interpolated control is off by 1e-3; that is the noise here.
        members.iter_mut().for_each(|member| member.trial.noise = vec![1e-3]);
        assert!(Vote(&motion).off_course(&members[0]).unwrap());
        assert!(!Vote(&motion).off_course(&members[1]).unwrap());
    }

    #[test]
    fn rollouts_are_apart_by_their_difference_up_to_a_limit() {
        let path = |value: f64| vec![Some(vec![value; 6])];
        assert_eq!(apart(&path(1.0), &path(1.5)), 0.5);
        assert_eq!(apart(&path(1.0), &path(50.0)), APART);
        assert_eq!(apart(&path(1.0), &[None]), APART);
    }
}
