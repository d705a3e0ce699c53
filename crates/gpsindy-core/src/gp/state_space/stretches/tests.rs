use super::super::events::Unit;
use super::super::matern::FiveHalves;
use super::super::overlap::AGREE;
use super::*;
use crate::gp::points::Points;

fn points(n: usize) -> Points {
    let time: Vec<f64> = (0..n).map(|i| 0.1 * i as f64 + 0.03 * (1.7 * i as f64).sin()).collect();
    let values: Vec<f64> = time.iter().map(|t| t.sin() + 0.3 * (7.0 * t * t).sin()).collect();
    Points::in_time(&time, &values)
}

/// The law by a plan of one's own.
fn law(points: &Points, length: f64, plan: impl Fn(&Scaled, &Events) -> Option<Plan>) -> Option<Vec<Vec<f64>>> {
    let scaled = Scaled::new(&[0.0, length, -1.0], FiveHalves::RATE, 0.0).unwrap();
    let events = Events::new(points, &[]);
    let mut columns = vec![vec![0.0; points.len()]; 4];
    let mut parts = columns.iter_mut();
    let unit = Unit { factor: 1.0, offset: 0.0, lowest: f64::NEG_INFINITY };
    let mut out: [Column<'_>; 4] = std::array::from_fn(|_| Column::new(parts.next().unwrap(), unit));
    let (plan, form) = (plan(&scaled, &events)?, std::marker::PhantomData::<FiveHalves>);
    let sweep =
        Sweep { scaled: &scaled, events: &events, plan, wanted: Wanted::Law, out: &mut out, lanes: Portable, form };
    sweep.run().then_some(columns)
}

#[test]
fn stretches_are_taken_where_the_memory_is_short_and_left_alone_where_it_is_long() {
    let plan = |scaled: &Scaled, events: &Events| Plan::new::<3, FiveHalves>(scaled, events);
    assert!(law(&points(4000), 0.0, plan).is_some());
    assert!(law(&points(400), 0.0, plan).is_none());
    // A length of e^9 s is longer than all of the log.
    assert!(law(&points(4000), 9.0, plan).is_none());
}

#[test]
fn an_overlap_that_is_too_short_is_noticed() {
    let early = |early| move |_: &Scaled, _: &Events| Some(Plan { length: 300, early, span: 0.0 });
    assert!(law(&points(2400), 0.0, early(150)).is_some());
    assert!(law(&points(2400), 0.0, early(10)).is_none());
}

#[test]
fn where_stretches_begin_does_not_show() {
    let lengths = |length| move |_: &Scaled, _: &Events| Some(Plan { length, early: 150, span: 0.0 });
    let [a, b] = [300, 411].map(|length| law(&points(2345), 0.0, lengths(length)).unwrap());
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        // What borders may differ by.
        assert!((a - b).abs() <= 10.0 * AGREE * (1.0 + b.abs()), "{a} {b}");
    }
}
