//! Prepares an identification: finds columns, adds velocities, cuts the training part, builds the library.

use crate::data::{Channel, Dataset, Run};
use crate::error::{Error, Result};
use crate::identify::equations::{DelayValue, Equations, rate_name};
use crate::identify::limits::{DELAYED_PERIODS, DELAYED_SHARES, FEWEST, STUCK};
use crate::identify::notes::Note;
use crate::identify::settings::{Delay, Identify};
use crate::library::Library;
use crate::progress::Progress;
use faer::Mat;
use std::borrow::Cow;
use std::sync::Arc;

/// The logs as they are learnt from.
#[derive(Clone)]
pub(crate) struct Logs {
    /// Training part: states, controls, then logged derivatives.
    pub(crate) data: Dataset,
    /// The same with nothing in the columns that no sensor measured: the refinement compares with this.
    pub(crate) measured: Dataset,
    /// States that no sensor measured.
    pub(crate) unmeasured: Vec<usize>,
    /// Column of every state's logged derivative, where there is one.
    pub(crate) rates: Vec<Option<usize>>,
    /// Equations without a term, with what is known beforehand; delays that are to be estimated are 0.
    pub(crate) frame: Equations,
    pub(crate) notes: Vec<Note>,
}

/// Finds the columns, takes velocities that no log carries from slopes, cuts the training part and makes the library.
pub(crate) fn prepare(settings: &Identify, logged: &Dataset, progress: &dyn Progress) -> Result<Logs> {
    let ranges = settings.sensor_ranges()?;
    // What a sensor shows at its end is no value of the state: nothing is smoothed through it.
    let within = if settings.ranges.is_empty() { Cow::Borrowed(logged) } else { Cow::Owned(inside(settings, logged)?) };
    let (whole, mut notes) = settings.with_velocities(&within, progress)?;
    let longest_delay = sensible_delay(logged);
    let (data, rates) = training(settings, &whole)?;
    let is_measured = |s: &usize| logged.index_of(&settings.states[*s]).is_ok();
    let unmeasured: Vec<usize> = (0..settings.states.len()).filter(|s| !is_measured(s)).collect();
    let measured = without(&with_ends(settings, &data, logged)?, &unmeasured)?;
    notes.extend(lines_of_time(&data, settings.states.len()));
    notes.extend((0..settings.states.len()).filter(|&s| ranges[s] == WHOLE).filter_map(|s| stuck(&measured, s)));
    let period = data.runs().iter().map(|run| mean_period(&run.time)).fold(f64::INFINITY, f64::min);
    let frame = frame(settings, &data, &rates, || delays(settings, period, longest_delay))?;
    let frame = Equations { ranges, ..frame };
    Ok(Logs { data, measured, unmeasured, rates, frame, notes })
}

/// Equations without a term, over the library of the settings; the delays are asked for once that is known to be good.
fn frame(
    settings: &Identify,
    data: &Dataset,
    rates: &[Option<usize>],
    delays: impl FnOnce() -> Result<Vec<DelayValue>>,
) -> Result<Equations> {
    let (n, m) = (settings.states.len(), settings.controls.len());
    let library = Arc::new(Library::new(&settings.states, &settings.controls, &settings.library)?);
    settings.constraints.check(&settings.states, &library)?;
    let (states, controls) = (&data.channels()[..n], &data.channels()[n..n + m]);
    let frame = Equations::new(states, controls, &library, &settings.constraints, delays()?)?;
    let bounds = settings.library.numbers.iter().map(|number| number.bounds).collect();
    Ok(Equations { derivative_given: rates.iter().map(Option::is_some).collect(), bounds, ..frame })
}

impl Logs {
    /// The same logs for settings that differ in the library alone.
    pub(crate) fn with_library_of(&self, settings: &Identify) -> Result<Self> {
        let frame = frame(settings, &self.data, &self.rates, || Ok(self.frame.delays.clone()))?;
        let ranges = self.frame.ranges.clone();
        Ok(Self { frame: Equations { ranges, ..frame }, ..self.clone() })
    }

    /// The frame with these delays, one a control.
    pub(crate) fn frame_with(&self, delays: &[DelayValue]) -> Equations {
        Equations { delays: delays.to_vec(), ..self.frame.clone() }
    }

    /// Number of states.
    pub(crate) fn n_states(&self) -> usize {
        self.rates.len()
    }

    /// Columns of the states.
    pub(crate) fn states(&self) -> Vec<usize> {
        (0..self.n_states()).collect()
    }

    /// Columns of the controls.
    pub(crate) fn controls(&self) -> Vec<usize> {
        (self.n_states()..self.n_states() + self.frame.controls.len()).collect()
    }
}

/// The range of a sensor that shows all. Exact.
const WHOLE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

impl Identify {
    /// The range of every state's sensor.
    fn sensor_ranges(&self) -> Result<Vec<(f64, f64)>> {
        if let Some(other) = self.ranges.iter().find(|one| !self.states.contains(&one.state)) {
            return Err(Error::unknown("state", &other.state, &self.states));
        }
        let of = |state: &String| self.ranges.iter().find(|one| one.state == *state).map_or(WHOLE, |one| one.range);
        Ok(self.states.iter().map(of).collect())
    }
}

/// `logged` without the values at the ends of sensors.
fn inside(settings: &Identify, logged: &Dataset) -> Result<Dataset> {
    let of =
        |c: &usize| settings.ranges.iter().find(|one| one.state == logged.channels()[*c].name).map(|one| one.range);
    let ranges: Vec<Option<(f64, f64)>> = (0..logged.channels().len()).map(|c| of(&c)).collect();
    let runs = logged.runs().iter().map(|run| {
        let is_inside = |value: f64, (low, high): (f64, f64)| value > low && value < high;
        let kept = |i: usize, j: usize| ranges[j].is_none_or(|range| is_inside(run.values[(i, j)], range));
        let value = |i: usize, j: usize| if kept(i, j) { run.values[(i, j)] } else { f64::NAN };
        Run { values: Mat::from_fn(run.n_samples(), run.values.ncols(), value), ..run.clone() }
    });
    Dataset::new(logged.channels().to_vec(), runs.collect())
}

/// The training part `data` with the values at the ends of sensors, as `logged` has them.
fn with_ends(settings: &Identify, data: &Dataset, logged: &Dataset) -> Result<Dataset> {
    if settings.ranges.is_empty() {
        return Ok(data.clone());
    }
    let own = |c: &usize| {
        let name = &data.channels()[*c].name;
        let is_cut = settings.ranges.iter().any(|one| one.state == *name);
        logged.index_of(name).ok().filter(|_| is_cut)
    };
    let columns: Vec<Option<usize>> = (0..data.channels().len()).map(|c| own(&c)).collect();
    let runs = data.runs().iter().map(|run| {
        let whole = logged.runs().iter().find(|other| other.name == run.name && other.time[0] == run.time[0]);
        let value = |i: usize, j: usize| match (columns[j], whole) {
            (Some(c), Some(whole)) => whole.values[(i, c)],
            _ => run.values[(i, j)],
        };
        Run { values: Mat::from_fn(run.n_samples(), run.values.ncols(), value), ..run.clone() }
    });
    Dataset::new(data.channels().to_vec(), runs.collect())
}

/// A remark where a column runs into its largest or smallest value and stays there: more often than one sample in a hundred is
/// there, behind a step no smaller than usual. What comes to rest slows down before.
fn stuck(data: &Dataset, column: usize) -> Option<Note> {
    let values = || data.runs().iter().flat_map(|run| run.column(column).iter().copied()).filter(|v| v.is_finite());
    let steps = |run: &Run| run.column(column).windows(2).map(|w| (w[1] - w[0]).abs()).collect::<Vec<f64>>();
    let mut all: Vec<f64> = data.runs().iter().flat_map(steps).filter(|step| *step > 0.0).collect();
    all.sort_by(f64::total_cmp);
    let usual = *all.get(all.len() / 2)?;
    let held = |run: &Run, end: f64| {
        let (column, mut count, mut inside) = (run.column(column), 0, false);
        for i in 1..column.len() {
            let is_there = column[i] == end && column[i - 1] == end;
            let ran_into = is_there && i > 1 && (column[i - 1] - column[i - 2]).abs() >= usual;
            inside = is_there && (inside || ran_into);
            count += usize::from(inside);
        }
        count as f64
    };
    let share = |end: f64| data.runs().iter().map(|run| held(run, end)).sum::<f64>() / values().count() as f64;
    let ends = [(true, values().fold(f64::NEG_INFINITY, f64::max)), (false, values().fold(f64::INFINITY, f64::min))];
    let (largest, value) = ends.into_iter().find(|(_, end)| share(*end) > STUCK)?;
    let name = data.channels()[column].name.clone();
    Some(Note::AtItsEnd { column: name, value, largest, share: share(value) })
}

/// `data` with nothing but missing values in these columns.
fn without(data: &Dataset, columns: &[usize]) -> Result<Dataset> {
    let runs = data.runs().iter().map(|run| {
        let value = |i: usize, j: usize| if columns.contains(&j) { f64::NAN } else { run.values[(i, j)] };
        Run { values: Mat::from_fn(run.n_samples(), run.values.ncols(), value), ..run.clone() }
    });
    Dataset::new(data.channels().to_vec(), runs.collect())
}

/// A remark for every state that is a straight line of time in every run: a clock or a row number, most likely.
fn lines_of_time(data: &Dataset, n_states: usize) -> Vec<Note> {
    let is_line = |c: usize| data.runs().iter().all(|run| run.is_line_of_time(c));
    let lines = (0..n_states).filter(|&c| is_line(c));
    lines.map(|c| Note::LineOfTime { state: data.channels()[c].name.clone() }).collect()
}

/// Mean sampling period, s.
pub(crate) fn mean_period(time: &[f64]) -> f64 {
    (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64
}

/// The longest delay that is looked for where none is named, s: as far as sampling and length of the runs allow.
fn sensible_delay(data: &Dataset) -> f64 {
    let length = |run: &Run| run.time[run.time.len() - 1] - run.time[0];
    let shortest = data.runs().iter().map(length).fold(f64::INFINITY, f64::min);
    let period = data.runs().iter().map(Run::period).fold(0.0, f64::max);
    let (least, most) = DELAYED_SHARES;
    (DELAYED_PERIODS * period).max(least * shortest).min(most * shortest)
}

/// One delay a control.
fn delays(settings: &Identify, period: f64, longest: f64) -> Result<Vec<DelayValue>> {
    let mut delays = vec![DelayValue::known(0.0, period); settings.controls.len()];
    for (control, delay) in &settings.delays {
        let k = settings.controls.iter().position(|c| c == control);
        let k = k.ok_or_else(|| Error::unknown("control", control, &settings.controls))?;
        let usable = |value: f64| value >= 0.0 && value.is_finite();
        match *delay {
            Delay::Fixed(value) if usable(value) => delays[k].value = value,
            Delay::Auto(None) => (delays[k].free, delays[k].most) = (true, longest),
            Delay::Auto(Some(most)) if usable(most) && most > 0.0 => (delays[k].free, delays[k].most) = (true, most),
            Delay::Fixed(value) | Delay::Auto(Some(value)) => {
                return Err(Error::range("delay", "at least 0 and finite, in s", value));
            }
        }
    }
    Ok(delays)
}

/// The columns in use, under the names of the model, of the first part of every run; and where logged derivatives are.
fn training(settings: &Identify, data: &Dataset) -> Result<(Dataset, Vec<Option<usize>>)> {
    if settings.states.is_empty() {
        return Err(Error::settings("no state named; say which columns are states"));
    }
    let fraction = settings.train_fraction;
    if !(fraction > 0.0 && fraction <= 1.0) {
        return Err(Error::range("train_fraction", "above 0 and at most 1", fraction));
    }
    for (state, _) in &settings.derivatives {
        if !settings.states.contains(state) {
            return Err(Error::unknown("state", state, &settings.states));
        }
    }
    let mut columns = data.indices_of(&settings.states)?;
    columns.extend(data.indices_of(&settings.controls)?);
    let mut channels: Vec<Channel> = columns.iter().map(|&c| data.channels()[c].clone()).collect();
    let mut rates = vec![None; settings.states.len()];
    for (state, rate) in settings.states.iter().zip(&mut rates) {
        if let Some((_, column)) = settings.derivatives.iter().find(|(s, _)| s == state) {
            *rate = Some(columns.len());
            columns.push(data.index_of(column)?);
            channels.push(Channel::new(rate_name(state)));
        }
    }
    let runs = data.runs().iter().map(|run| {
        let end = run.time.partition_point(|&t| t <= settings.training_end(run));
        Run {
            name: run.name.clone(),
            time: run.time[..end].to_vec(),
            values: Mat::from_fn(end, columns.len(), |i, j| run.values[(i, columns[j])]),
        }
    });
    let runs: Vec<Run> = runs.collect();
    let longest = runs.iter().map(Run::n_samples).max().unwrap_or(0);
    let runs: Vec<Run> = runs.into_iter().filter(|run| run.n_samples() >= FEWEST).collect();
    if runs.is_empty() {
        return Err(Error::TooFewSamples {
            what: "training part of the longest run".into(),
            needed: FEWEST,
            found: longest,
        });
    }
    Ok((Dataset::new(channels, runs)?, rates))
}
