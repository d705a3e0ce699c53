//! What each stage of a diagnosis did with the logs, and how long it took.

use gpsindy_core::diagnose::report::StageWork;

/// One row a stage, and their sum. Thousands of samples, lanes side by side counted once.
pub(super) fn table(work: &[StageWork], seconds: &[f64]) -> String {
    let header = format!(
        "{:>8} {:>6} {:>8} {:>12} {:>8} {:>10}  stage",
        "seconds", "fits", "columns", "derivatives", "trials", "responses"
    );
    let row = |seconds: f64, w: &StageWork| {
        let thousands = |samples: u64| format!("{:.0}k", samples as f64 / 1000.0);
        format!(
            "{seconds:>8.2} {:>6} {:>8} {:>12} {:>8} {:>10}  {}",
            w.fits,
            w.columns,
            thousands(w.derivatives),
            thousands(w.trials),
            thousands(w.responses),
            w.stage
        )
    };
    let sum = |of: fn(&StageWork) -> u64| work.iter().map(of).sum();
    let whole = StageWork {
        stage: "all".into(),
        fits: sum(|w| w.fits),
        columns: sum(|w| w.columns),
        derivatives: sum(|w| w.derivatives),
        trials: sum(|w| w.trials),
        responses: sum(|w| w.responses),
    };
    let rows = work.iter().zip(seconds).map(|(w, &s)| row(s, w));
    let last = row(seconds.iter().sum(), &whole);
    std::iter::once(header).chain(rows).chain(std::iter::once(last)).collect::<Vec<_>>().join("\n")
}
