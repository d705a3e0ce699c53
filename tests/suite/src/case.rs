//! Draws one case of a seed: a plant, its runs, what is withheld, and the logs as sensors would give them.

use crate::choose::{Frame, Offer, catalogue, outside};
use crate::effect::{Act, Effect};
use crate::gap::{Gap, Log, Ruler};
use crate::plant::Plant;
use crate::plants::families;
use crate::random::{Draw, digits};
use crate::scene::scene;
use crate::second::second;
use crate::sensor::{Noise, Sensing};
use crate::simulate::{Machine, Setup, Trace};
use crate::survey::{Survey, survey};
use crate::twins::{Outcome, compete};

/// What kind of case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// One effect of the catalogue.
    Single,
    /// Two effects of the catalogue.
    Pair,
    /// An effect that the catalogue lacks.
    Outside,
    /// One effect of the catalogue, and a smaller one that the catalogue lacks.
    Beside,
    /// Nothing.
    Null,
    /// One effect of the second part of the catalogue.
    Second,
}

/// A drawn case.
pub struct Case {
    /// Its seed.
    pub seed: u64,
    /// Its kind.
    pub kind: Kind,
    /// The plant with nominal parameters.
    pub plant: Plant,
    /// What is withheld.
    pub effects: Vec<Effect>,
    /// The runs: the given ones first, then two held-out ones.
    pub runs: Vec<Run>,
    /// How many of them are given.
    pub given: usize,
    /// Noise by logged column, quantisation included.
    pub noise: Vec<f64>,
    /// What may mislead.
    pub trap: String,
    /// Gap of the held-out runs.
    pub gap: Gap,
    /// Seconds after which a rollout of an unstable plant starts afresh; 0: never.
    pub reset: f64,
    /// Sizes of the states.
    pub survey: Survey,
    /// What the rivals leave, by effect.
    pub outcomes: Vec<Option<Outcome>>,
}

/// A run with its log.
pub struct Run {
    /// How it was made.
    pub setup: Setup,
    /// Noise-free run.
    pub trace: Trace,
    /// Logged columns by sample, NaN where missing.
    pub log: Vec<Vec<f64>>,
}

/// Held-out runs of a case.
pub const HELD_OUT: usize = 2;

/// Draws the case of a seed; `None` when forty plants in a row refused.
pub fn draw_case(seed: u64, kind: Option<Kind>) -> Option<Case> {
    draw_named(seed, kind, None)
}

/// As [`draw_case`] with the effect of this name only, on the first of 400 plants that takes it.
pub fn draw_named(seed: u64, kind: Option<Kind>, id: Option<&str>) -> Option<Case> {
    let kind = kind.unwrap_or_else(|| {
        let share = Draw::new(seed, 0).unit();
        match share {
            s if s < 0.50 => Kind::Single,
            s if s < 0.60 => Kind::Pair,
            s if s < 0.75 => Kind::Outside,
            _ => Kind::Null,
        }
    });
    let attempts = if id.is_some() { 400 } else { 40 };
    (1..=attempts).find_map(|attempt| try_case(seed, attempt, kind, id))
}

fn run_all(plant: &Plant, effects: &[Effect], setups: &[Setup], scale: &[f64]) -> Option<Vec<Trace>> {
    let machine = Machine::new(plant, effects, scale, 1e-8);
    setups.iter().map(|s| machine.run(s)).collect()
}

fn try_case(seed: u64, attempt: u64, kind: Kind, id: Option<&str>) -> Option<Case> {
    let mut draw = Draw::new(seed, attempt);
    let list = families();
    let mut plant = list[draw.index(list.len())](&mut draw);
    let tolerated = draw.chance(0.6);
    for parameter in &mut plant.parameters {
        let tolerance = digits(draw.log(0.01, 0.1), 1);
        if tolerated && !parameter.certain && draw.chance(0.6) {
            parameter.tolerance = Some(tolerance);
        }
    }
    let mut scene = scene(&plant, &mut draw, kind == Kind::Null);
    let reset = if plant.feedback.as_ref().is_some_and(|f| f.unstable) { 1.0 } else { 0.0 };
    let first: Vec<f64> = plant.states.iter().map(|s| s.start.0.abs() + s.start.1.abs() + 1e-3).collect();
    let nominal = run_all(&plant, &[], &scene.setups, &first)?;
    let quiet = survey(&plant, &nominal);
    if plant.logged.iter().any(|&i| quiet.spread[i] <= 1e-6 * (1.0 + quiet.mean[i].abs())) {
        return None;
    }
    let sensing = Sensing::draw(&plant, &quiet, kind == Kind::Null, &mut draw);
    if !sensing.plain {
        // One trap at a time.
        scene.setups.iter_mut().for_each(|s| s.linear = false);
    }
    let scale: Vec<f64> = quiet.spread.iter().zip(&first).map(|(s, f)| s.max(1e-3 * f)).collect();
    sensing.feed_back(&plant, &mut scene.setups, seed, attempt);
    let nominal = run_all(&plant, &[], &scene.setups, &scale)?;
    let known = survey(&plant, &nominal);
    let lowest = if plant.positive { 0.0 } else { f64::NEG_INFINITY };
    if plant.logged.iter().any(|&i| known.low[i] < lowest || known.spread[i] > 50.0 * quiet.spread[i].max(1e-9)) {
        return None;
    }
    let span = (scene.setups[0].times[0], scene.setups[scene.given - 1].times.last().copied()?);
    let frame = Frame { interval: scene.interval, span };
    let mut trap = sensing.trap.clone();
    let noise = sensing.noise.clone();
    let ruler = Ruler { plant: &plant, noise: &noise, scale: &scale, reset };
    let search = Search { ruler: &ruler, setups: &scene.setups, given: scene.given, survey: &known, frame: &frame };
    let (effects, gap) = match kind {
        Kind::Null => {
            let wrong = sensing.plain && !scene.setups[0].linear && draw.chance(0.1);
            let effects = if wrong { within_tolerance(&plant, &mut draw) } else { Vec::new() };
            if !effects.is_empty() {
                trap = "parameter within its tolerance".into();
            }
            let gap = search.gap(&effects)?;
            if !effects.is_empty() && gap.snr > 0.5 {
                return None;
            }
            (effects, gap)
        }
        Kind::Single | Kind::Outside | Kind::Second => {
            let mut menu = match kind {
                Kind::Single => catalogue(&plant, &known, &frame, &mut draw),
                Kind::Second => second(&plant, &known, &frame, &mut draw),
                _ => outside(&plant, &known, &mut draw),
            };
            menu.retain(|offer| id.is_none_or(|id| offer.id == id));
            let option = pick(&menu, &[], &mut draw)?;
            let (least, most) = match kind {
                Kind::Outside => (3.0, 30.0),
                Kind::Second => (3.0, 15.0),
                _ => (1.0, 30.0),
            };
            let target = draw.log(least, most);
            search.sized(option, target, least)?
        }
        Kind::Beside => {
            let menu = catalogue(&plant, &known, &frame, &mut draw);
            let one = pick(&menu, &[], &mut draw)?;
            let (mut effects, alone) = search.sized(one, draw.log(5.0, 30.0), 5.0)?;
            let rests = outside(&plant, &known, &mut draw);
            let two = pick(&rests, &effects, &mut draw)?;
            let (rest, _) = search.sized(two, (alone.snr * draw.log(0.05, 0.5)).max(1.0), 0.8)?;
            effects.extend(rest);
            let gap = search.gap(&effects)?;
            (effects, gap)
        }
        Kind::Pair => {
            let menu = catalogue(&plant, &known, &frame, &mut draw);
            let one = pick(&menu, &[], &mut draw)?;
            let (mut effects, _) = search.sized(one, draw.log(3.0, 15.0), 3.0)?;
            let two = pick(&menu, &effects, &mut draw)?;
            let (second, _) = search.sized(two, draw.log(3.0, 15.0), 3.0)?;
            effects.extend(second);
            let gap = search.gap(&effects)?;
            // Two effects that undo each other would leave nothing to see.
            if gap.snr < 3.0 || crate::twins::alike(&plant, &known, &effects[0], &effects[1]) {
                return None;
            }
            (effects, gap)
        }
    };
    let traces = run_all(&plant, &effects, &scene.setups, &scale)?;
    for (trace, calm) in traces.iter().zip(&nominal) {
        let wild = |i: usize| {
            let reach = |t: &Trace| t.states.iter().map(|x| (x[i] - known.mean[i]).abs()).fold(0.0, f64::max);
            reach(trace) > 8.0 * reach(calm).max(3.0 * known.spread[i])
        };
        if (0..plant.states.len()).any(wild) || trace.readings.iter().flatten().any(|v| !v.is_finite()) {
            return None;
        }
        if plant.positive && trace.states.iter().any(|x| x.iter().any(|&v| v < 0.0)) {
            return None;
        }
    }
    let mut outcomes = Vec::new();
    if kind != Kind::Null {
        let given = &scene.setups[..scene.given];
        for (k, effect) in effects.iter().enumerate() {
            // Each effect is judged alone.
            let alone =
                if effects.len() == 1 { None } else { run_all(&plant, std::slice::from_ref(effect), given, &scale) };
            let alone = alone.as_ref().unwrap_or(&traces);
            let logs: Vec<Log> = given.iter().zip(alone).map(|(s, trace)| Log { times: &s.times, trace }).collect();
            outcomes.push(compete(&ruler, &known, &logs, false, effect, k));
        }
    }
    // What hardly shows in the given runs cannot be asked of anybody.
    let shown = |o: &Outcome| (o.gap / o.count as f64).sqrt() > 0.6f64.max(0.25 * gap.snr.min(12.0));
    // A rest need not be named separately.
    let asked = if kind == Kind::Beside { 1 } else { outcomes.len() };
    if !outcomes.iter().take(asked).all(|o| o.as_ref().is_some_and(shown)) {
        return None;
    }
    if kind == Kind::Outside {
        // What one effect of the catalogue covers within the noise is not outside it.
        let outcome = outcomes[0].as_ref()?;
        let best = outcome.near.iter().map(|f| f.left).fold(outcome.gap, f64::min);
        if best < 0.02 * outcome.gap || (best / outcome.count as f64).sqrt() < 0.7 {
            return None;
        }
    }
    if scene.setups.iter().any(|s| s.linear) {
        trap = join(&trap, "control interpolated between samples");
    }
    if plant.feedback.is_some() {
        trap = join(&trap, "closed loop");
    }
    let setups = std::mem::take(&mut scene.setups);
    let runs = setups
        .into_iter()
        .zip(traces)
        .enumerate()
        .map(|(k, (setup, trace))| {
            let log = sensing.read(&plant, &setup, &trace, &mut Noise::of_run(seed, attempt, k));
            Run { setup, trace, log }
        })
        .collect();
    // A parameter within its tolerance is no gap that anybody should name.
    let effects = if kind == Kind::Null { Vec::new() } else { effects };
    let given = scene.given;
    Some(Case { seed, kind, plant, effects, runs, given, noise, trap, gap, reset, survey: known, outcomes })
}

fn join(a: &str, b: &str) -> String {
    if a.is_empty() { b.into() } else { format!("{a}, {b}") }
}

/// A parameter that is off by less than its tolerance.
fn within_tolerance(plant: &Plant, draw: &mut Draw) -> Vec<Effect> {
    let list: Vec<usize> = (0..plant.parameters.len()).filter(|&k| plant.parameters[k].tolerance.is_some()).collect();
    let Some(&index) = list.get(draw.index(list.len().max(1))) else { return Vec::new() };
    let parameter = &plant.parameters[index];
    let off = parameter.tolerance.unwrap_or(0.0) * draw.uniform(-1.0, 1.0);
    let act = Act::Parameter { index, value: digits(parameter.value * (1.0 + off), 6) };
    vec![Effect { id: "parameter_error", state: 0, variables: vec![], act }]
}

/// Picks an id first, so that an effect with many places is no likelier than one with few.
fn pick<'a>(menu: &'a [Offer], taken: &[Effect], draw: &mut Draw) -> Option<&'a Offer> {
    let free = |o: &&Offer| {
        let there = (o.at)(0.1);
        taken.iter().all(|t| {
            let both = matches!((t.act, there.act), (Act::Friction { .. }, Act::Friction { .. }));
            let same = t.id == o.id && t.state == there.state && t.variables == there.variables;
            let loops = matches!((t.act, there.act), (Act::Actuator { control: a, .. }, Act::Actuator { control: b, .. }) if a == b);
            !(both || same || loops)
        })
    };
    let mut ids: Vec<&str> = menu.iter().filter(free).map(|o| o.id).collect();
    ids.sort_unstable();
    ids.dedup();
    let id = *ids.get(draw.index(ids.len()))?;
    let list: Vec<&Offer> = menu.iter().filter(free).filter(|o| o.id == id).collect();
    list.get(draw.index(list.len())).copied()
}

struct Search<'a> {
    ruler: &'a Ruler<'a>,
    setups: &'a [Setup],
    given: usize,
    survey: &'a Survey,
    frame: &'a Frame,
}

impl Search<'_> {
    /// Gap of the held-out runs.
    fn gap(&self, effects: &[Effect]) -> Option<Gap> {
        let held = &self.setups[self.given..];
        let traces = run_all(self.ruler.plant, effects, held, self.ruler.scale)?;
        let logs: Vec<Log> = held.iter().zip(&traces).map(|(s, trace)| Log { times: &s.times, trace }).collect();
        self.ruler.gap(&logs, &[])
    }

    /// The effect at the size whose gap is `target`, or at its largest size when that gap is at least `least`.
    fn sized(&self, option: &Offer, target: f64, least: f64) -> Option<(Vec<Effect>, Gap)> {
        let (mut low, mut high): (f64, f64) = (1e-5, 1.0);
        let mut size = 0.1;
        let mut best: Option<(f64, Vec<Effect>, Gap)> = None;
        for _ in 0..14 {
            let effects = vec![(option.at)(size)];
            let found = self.gap(&effects);
            let snr = found.as_ref().map_or(f64::INFINITY, |g| g.snr);
            if let Some(gap) = found {
                let miss = (gap.snr / target).ln().abs();
                if best.as_ref().is_none_or(|b| miss < b.0) {
                    best = Some((miss, effects, gap));
                }
            }
            if best.as_ref().is_some_and(|b| b.0 < 0.05) {
                break;
            }
            if snr > target {
                high = high.min(size)
            } else {
                low = low.max(size)
            }
            if low >= 1.0 {
                break;
            }
            // The gap grows about with the size; the bracket keeps the guess honest.
            let guess = size * target / snr.max(1e-12);
            let middle = (low * high).sqrt();
            size = if guess.is_finite() && guess > low && guess < high { guess } else { middle };
            if high >= 1.0 && guess >= 1.0 {
                size = 1.0;
            }
        }
        let (miss, effects, gap) = best?;
        // Accept what is near the wanted gap, or the largest size where the plant hardly shows the effect.
        let near = (miss < 0.3 && gap.snr > 0.9 * least) || (gap.snr < target && gap.snr >= least);
        let timed = effects[0].act.numbers().iter().all(|(name, v)| *name != "tau" || *v > 0.4 * self.frame.interval);
        let visible = self.survey.spread.iter().all(|s| s.is_finite());
        (near && timed && visible && gap.snr < 35.0).then_some((effects, gap))
    }
}
