//! An excerpt of logs that are longer than an identification needs: their most exciting windows, each a run of its own.

use crate::data::{Dataset, Run};
use crate::error::Result;
use crate::excitation::{choose, excitation, variance};
use crate::identify::limits::{MOST_SAMPLES, WINDOW};
use crate::identify::notes::Note;
use crate::identify::settings::Identify;
use faer::Mat;

/// A stretch of a run.
struct Window {
    run: usize,
    first: usize,
    /// One past the last sample.
    end: usize,
}

/// The windows of the training part to learn from, and what to say of the rest; none where the logs are short enough.
pub(crate) fn excerpt(settings: &Identify, data: &Dataset) -> Result<Option<(Dataset, Note)>> {
    let ends = data.runs().iter().map(|run| run.time.partition_point(|&t| t <= settings.training_end(run)));
    let ends: Vec<usize> = ends.collect();
    let total: usize = ends.iter().sum();
    if total <= MOST_SAMPLES {
        return Ok(None);
    }
    let derivatives = settings.derivatives.iter().map(|(_, column)| column);
    let names = settings.states.iter().chain(&settings.controls).chain(derivatives);
    let columns: Vec<usize> = names.filter_map(|name| data.index_of(name).ok()).collect();
    let spread = |&column: &usize| {
        let each = data.runs().iter().zip(&ends).map(|(run, &end)| variance(&run.column(column)[..end]) * end as f64);
        (each.sum::<f64>() / total as f64).sqrt()
    };
    let spreads: Vec<f64> = columns.iter().map(spread).collect();
    let windows: Vec<Window> = ends.iter().enumerate().flat_map(|(run, &end)| cut(run, end)).collect();
    let moves = |w: &Window| {
        let run = &data.runs()[w.run];
        excitation(columns.iter().zip(&spreads).map(|(&c, &spread)| (&run.column(c)[w.first..w.end], spread)))
    };
    let count = (MOST_SAMPLES * windows.len()).div_ceil(total);
    let chosen: Vec<&Window> =
        choose(&windows.iter().map(moves).collect::<Vec<_>>(), count).into_iter().map(|i| &windows[i]).collect();
    let note = Note::Excerpt {
        samples: total,
        used: chosen.iter().map(|w| w.end - w.first).sum(),
        windows: chosen.len(),
        of: windows.len(),
    };
    let runs = chosen.iter().map(|w| part(data, w)).collect();
    Ok(Some((Dataset::new(data.channels().to_vec(), runs)?, note)))
}

/// Equal windows of the first `end` samples of a run.
fn cut(run: usize, end: usize) -> impl Iterator<Item = Window> {
    let parts = end.div_ceil(WINDOW);
    (0..parts).map(move |k| Window { run, first: k * end / parts, end: (k + 1) * end / parts })
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::Channel;

    #[test]
    fn of_a_long_run_the_windows_that_move_are_kept_and_the_rest_is_stated() {
        let n = 4 * MOST_SAMPLES;
        // The last tenth moves.
        let value = |i: usize, _: usize| if i >= n - n / 10 { (0.01 * i as f64).sin() } else { 0.0 };
        let run = Run {
            name: "long".into(),
            time: (0..n).map(|i| 0.001 * i as f64).collect(),
            values: Mat::from_fn(n, 1, value),
        };
        let data = Dataset::new(vec![Channel::new("x")], vec![run.clone()]).unwrap();
        let settings = Identify { states: vec!["x".into()], ..Identify::default() };
        let (kept, note) = excerpt(&settings, &data).unwrap().unwrap();
        assert!(kept.n_samples() <= MOST_SAMPLES + WINDOW);
        let last = 0.001 * (n - n / 10) as f64;
        let moving = kept.runs().iter().filter(|run| run.time[run.n_samples() - 1] > last).count();
        // All five or so windows that move are there, and the others are of all parts.
        assert!(moving * WINDOW >= n / 10, "{moving}");
        assert!(kept.runs()[0].time[0] < 0.001 * (n / 4) as f64);
        assert!(kept.runs()[1].name.starts_with("long from "));
        assert!(note.to_string().contains("most exciting ones"), "{note}");
        // What is held out is never looked at.
        let (kept, _) = excerpt(&Identify { train_fraction: 0.5, ..settings.clone() }, &data).unwrap().unwrap();
        assert!(kept.runs().iter().all(|run| run.time[run.n_samples() - 1] <= 0.0005 * n as f64));
        let short = Dataset::new(vec![Channel::new("x")], vec![part(&data, &Window { run: 0, first: 0, end: 100 })]);
        assert!(excerpt(&settings, &short.unwrap()).unwrap().is_none());
    }
}
