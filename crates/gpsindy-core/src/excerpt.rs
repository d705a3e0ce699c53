//! An excerpt of long logs: their most exciting windows, each a run of its own.

use crate::data::{Dataset, Run};
use crate::error::Result;
use crate::excitation::{choose, excitation, variance};
use faer::Mat;

/// Windows of logs, as logs.
pub(crate) struct Excerpt {
    pub(crate) data: Dataset,
    /// How many windows it has, and how many of the same length there are.
    pub(crate) windows: usize,
    pub(crate) of: usize,
}

/// A stretch of a run.
struct Window {
    run: usize,
    first: usize,
    /// One past the last sample.
    end: usize,
}

/// About `most` samples of the logs, in windows of `window` samples or fewer: half of them spread over the logs, half those in which the
/// `columns` move most. Of each run only samples before its `end` are looked at.
pub(crate) fn excerpt(
    data: &Dataset,
    columns: &[usize],
    ends: &[usize],
    (window, most): (usize, usize),
) -> Result<Excerpt> {
    let total: usize = ends.iter().sum();
    let spread = |&column: &usize| {
        let each = data.runs().iter().zip(ends).map(|(run, &end)| variance(&run.column(column)[..end]) * end as f64);
        (each.sum::<f64>() / total.max(1) as f64).sqrt()
    };
    let spreads: Vec<f64> = columns.iter().map(spread).collect();
    let windows: Vec<Window> = ends.iter().enumerate().flat_map(|(run, &end)| cut(run, end, window)).collect();
    let moves = |w: &Window| {
        let run = &data.runs()[w.run];
        excitation(columns.iter().zip(&spreads).map(|(&c, &spread)| (&run.column(c)[w.first..w.end], spread)))
    };
    let count = (most * windows.len()).div_ceil(total.max(1));
    let chosen = choose(&windows.iter().map(moves).collect::<Vec<_>>(), count);
    let runs = chosen.iter().map(|&i| part(data, &windows[i])).collect();
    let data = Dataset::new(data.channels().to_vec(), runs)?;
    Ok(Excerpt { data, windows: chosen.len(), of: windows.len() })
}

/// Equal windows of the first `end` samples of a run.
fn cut(run: usize, end: usize, window: usize) -> impl Iterator<Item = Window> {
    let parts = end.div_ceil(window.max(1));
    (0..parts).map(move |k| Window { run, first: k * end / parts, end: (k + 1) * end / parts })
}

/// The recording of a run that is perhaps a window of it.
pub(crate) fn recording(run: &str) -> &str {
    let of_window = run.rsplit_once(" from ").filter(|(_, place)| place.ends_with(" s"));
    of_window.map_or(run, |(recording, _)| recording)
}

fn part(data: &Dataset, window: &Window) -> Run {
    let run = &data.runs()[window.run];
    let (first, end) = (window.first, window.end);
    let is_whole = first == 0 && end == run.n_samples();
    Run {
        name: if is_whole { run.name.clone() } else { format!("{} from {:.3} s", run.name, run.time[first]) },
        time: run.time[first..end].to_vec(),
        values: Mat::from_fn(end - first, run.values.ncols(), |i, j| run.values[(first + i, j)]),
    }
}
