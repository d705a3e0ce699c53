//! An excerpt of logs that are longer than an identification needs.

use crate::data::Dataset;
use crate::error::Result;
use crate::excerpt::{self, Excerpt};
use crate::identify::limits::WINDOW;
use crate::identify::notes::Note;
use crate::identify::settings::Identify;

/// The windows of the training part to learn from, about `most` samples, and what to say of the rest; none where the logs are short
/// enough.
pub(crate) fn excerpt(settings: &Identify, data: &Dataset, most: usize) -> Result<Option<(Dataset, Note)>> {
    let ends = data.runs().iter().map(|run| run.time.partition_point(|&t| t <= settings.training_end(run)));
    let ends: Vec<usize> = ends.collect();
    let total: usize = ends.iter().sum();
    if total <= most {
        return Ok(None);
    }
    let derivatives = settings.derivatives.iter().map(|(_, column)| column);
    let names = settings.states.iter().chain(&settings.controls).chain(derivatives);
    let columns: Vec<usize> = names.filter_map(|name| data.index_of(name).ok()).collect();
    let Excerpt { data, windows, of } = excerpt::excerpt(data, &columns, &ends, (WINDOW, most))?;
    let note = Note::Excerpt { samples: total, used: data.n_samples(), windows, of };
    Ok(Some((data, note)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::data::{Channel, Run};
    use crate::identify::limits::MOST_SAMPLES;
    use faer::Mat;

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
        let (kept, note) = excerpt(&settings, &data, MOST_SAMPLES).unwrap().unwrap();
        assert!(kept.n_samples() <= MOST_SAMPLES + WINDOW);
        let last = 0.001 * (n - n / 10) as f64;
        let moving = kept.runs().iter().filter(|run| run.time[run.n_samples() - 1] > last).count();
        // All five or so windows that move are there, and the others are of all parts.
        assert!(moving * WINDOW >= n / 10, "{moving}");
        assert!(kept.runs()[0].time[0] < 0.001 * (n / 4) as f64);
        assert!(kept.runs()[1].name.starts_with("long from "));
        assert!(note.to_string().contains("most exciting ones"), "{note}");
        // What is held out is never looked at.
        let (kept, _) =
            excerpt(&Identify { train_fraction: 0.5, ..settings.clone() }, &data, MOST_SAMPLES).unwrap().unwrap();
        assert!(kept.runs().iter().all(|run| run.time[run.n_samples() - 1] <= 0.0005 * n as f64));
        let short = data.filter_samples(|_, t| t < 0.1).unwrap();
        assert!(excerpt(&settings, &short, MOST_SAMPLES).unwrap().is_none());
    }
}
