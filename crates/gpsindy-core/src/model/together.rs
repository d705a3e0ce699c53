//! Tasks side by side whose calls of one simulator go together.
//!
//! A call of a simulator in another language costs as much as many of its steps, and a fit needs thousands of calls of a few rows each.
//! So each task has a thread of its own. When every task waits for the simulator, one call serves all of them. What a task gets does not depend on
//! the others, and the order of the rows does not depend on the threads' pace: a simulator whose solver starts from its last solution
//! gives the same numbers every time.

use super::{Dynamics, Rows, Steps};
use crate::error::{Error, Result};
use std::cell::RefCell;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Threads at most: with sixteen rows or more the steps of most simulators cost more than the call.
const MOST: usize = 16;

thread_local! {
    /// Where the task of this thread sits.
    static SEAT: RefCell<Option<Seat>> = const { RefCell::new(None) };
}

/// How long the rows of a call go on.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Span {
    /// A step of so many seconds for each row.
    Each(Vec<f64>),
    /// So many samples of so many whole steps each, with commands and forces of every sample.
    Rollout(usize, usize),
}

/// A call that waits for the others.
#[derive(Debug)]
struct Call {
    count: usize,
    /// States, commands, forces and parameters, row after row.
    parts: [Vec<f64>; 4],
    span: Span,
}

/// What a task waits for.
#[derive(Debug)]
enum Want {
    /// Nothing: it computes.
    Nothing,
    /// Another item.
    Item,
    Answer(Call),
    /// Nothing any more.
    Gone,
}

/// What a task gets.
#[derive(Debug)]
enum Served {
    /// The number of its item, and none where all are given away.
    Item(Option<usize>),
    Answer(Result<Vec<f64>>),
}

struct Table {
    simulator: Arc<dyn Dynamics>,
    orders: Mutex<Orders>,
    /// One a seat: threads that wait at one place are woken for nothing.
    places: Vec<(Mutex<Option<Served>>, Condvar)>,
}

struct Orders {
    wants: Vec<Want>,
    /// The next item, and how many there are.
    next: usize,
    count: usize,
}

/// A thread's place at the table; gives it up when dropped, so that no one waits for a task that panicked.
struct Seat {
    table: Arc<Table>,
    number: usize,
}

/// Calls that are being answered; a panic of the simulator leaves no one without an answer.
struct Unanswered<'a> {
    table: &'a Table,
    seats: Vec<usize>,
}

/// `one` of every item, in their order, by threads whose calls of the simulator go together.
pub(crate) fn together<T: Send, R: Send>(
    simulator: &Arc<dyn Dynamics>,
    items: Vec<T>,
    one: impl Fn(T) -> Result<R> + Send + Sync,
) -> Result<Vec<R>> {
    let count = items.len();
    let is_alone = count < 2 || cfg!(not(feature = "parallel")) || SEAT.with_borrow(Option::is_some);
    if is_alone {
        return items.into_iter().map(one).collect();
    }
    let threads = 0..count.min(MOST);
    let wants = threads.clone().map(|_| Want::Nothing).collect();
    let table = Arc::new(Table {
        simulator: simulator.clone(),
        orders: Mutex::new(Orders { wants, next: 0, count }),
        places: threads.clone().map(|_| Default::default()).collect(),
    });
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    let found: Vec<Mutex<Option<Result<R>>>> = (0..count).map(|_| Mutex::new(None)).collect();
    std::thread::scope(|scope| {
        for number in threads {
            let seat = Seat { table: table.clone(), number };
            let (table, items, found, one) = (&table, &items, &found, &one);
            scope.spawn(move || {
                SEAT.set(Some(seat));
                while let Some(next) = SEAT.with_borrow(|seat| seat.as_ref().and_then(Seat::next)) {
                    let item = lock(&items[next]).take();
                    let done = item.map(one);
                    if matches!(done, Some(Err(_))) {
                        table.end();
                    }
                    *lock(&found[next]) = done;
                }
                SEAT.set(None);
            });
        }
    });
    found.into_iter().filter_map(|found| found.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// States `next` after `span`, in one call with what other tasks wait for where this thread's task is one of several.
pub(crate) fn advance(engine: &dyn Steps, rows: &Rows<'_>, span: Span, next: &mut [f64]) -> Result<()> {
    SEAT.with_borrow(|seat| match seat {
        Some(seat) if seat.table.is_for(engine) => {
            let parts = [rows.states, rows.commands, rows.forces, rows.parameters].map(<[f64]>::to_vec);
            seat.answer(Call { count: rows.count, parts, span }).map(|answer| next.copy_from_slice(&answer))
        }
        _ => call(engine, rows, &span, next),
    })
}

fn call(engine: &dyn Steps, rows: &Rows<'_>, span: &Span, next: &mut [f64]) -> Result<()> {
    match span {
        Span::Rollout(samples, count) => engine.rollout(rows, (*samples, *count), next),
        Span::Each(dt) => match &dt[..] {
            [first, rest @ ..] if rest.iter().any(|other| other != first) => engine.unequal_steps(rows, dt, next),
            [first, ..] => engine.step(rows, *first, next),
            [] => Ok(()),
        },
    }
}

impl Seat {
    /// The number of the next item; none where there is none left.
    fn next(&self) -> Option<usize> {
        match self.wait(Want::Item) {
            Served::Item(next) => next,
            Served::Answer(_) => None,
        }
    }

    fn answer(&self, call: Call) -> Result<Vec<f64>> {
        match self.wait(Want::Answer(call)) {
            Served::Answer(answer) => answer,
            Served::Item(_) => Err(Error::Cancelled),
        }
    }

    /// Waits for what this seat wants; the last to come serves all.
    fn wait(&self, want: Want) -> Served {
        self.table.order(self.number, want);
        let (place, is_served) = &self.table.places[self.number];
        let mut served = lock(place);
        loop {
            match served.take() {
                Some(own) => return own,
                None => served = is_served.wait(served).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.table.order(self.number, Want::Gone);
    }
}

impl Drop for Unanswered<'_> {
    fn drop(&mut self) {
        self.seats.iter().for_each(|&seat| self.table.serve(seat, Served::Answer(Err(Error::Cancelled))));
    }
}

impl Table {
    fn is_for(&self, engine: &dyn Steps) -> bool {
        self.simulator.steps().is_some_and(|own| std::ptr::addr_eq(own, engine))
    }

    /// Gives no more items away.
    fn end(&self) {
        let mut orders = lock(&self.orders);
        orders.next = orders.count;
    }

    /// Notes what a seat wants, and serves all where no one computes.
    fn order(&self, seat: usize, want: Want) {
        let mut orders = lock(&self.orders);
        orders.wants[seat] = want;
        if orders.wants.iter().any(|want| matches!(want, Want::Nothing)) {
            return;
        }
        let Orders { wants, next, count } = &mut *orders;
        let (mut items, mut calls) = (Vec::new(), Vec::new());
        for (seat, want) in wants.iter_mut().enumerate() {
            match std::mem::replace(want, Want::Nothing) {
                Want::Item => {
                    items.push((seat, (*next < *count).then_some(*next)));
                    *next += 1;
                }
                Want::Answer(call) => calls.push((seat, call)),
                Want::Gone | Want::Nothing => *want = Want::Gone,
            }
        }
        // Whoever gets something goes on at once, and may want something new before all are served.
        drop(orders);
        items.into_iter().for_each(|(seat, item)| self.serve(seat, Served::Item(item)));
        let mut unanswered = Unanswered { table: self, seats: calls.iter().map(|(seat, _)| *seat).collect() };
        let kind = |call: &Call| if let Span::Rollout(samples, count) = call.span { (samples, count) } else { (0, 0) };
        calls.sort_by_key(|(seat, call)| (kind(call), *seat));
        for same in calls.chunk_by(|a, b| kind(&a.1) == kind(&b.1)) {
            for ((seat, _), answer) in same.iter().zip(self.answers(same)) {
                unanswered.seats.retain(|other| other != seat);
                self.serve(*seat, Served::Answer(answer));
            }
        }
    }

    fn serve(&self, seat: usize, served: Served) {
        let (place, is_served) = &self.places[seat];
        *lock(place) = Some(served);
        is_served.notify_one();
    }

    /// What each of some calls of one kind gets: by one call, and where that fails each by its own.
    fn answers(&self, calls: &[(usize, Call)]) -> Vec<Result<Vec<f64>>> {
        let width = self.simulator.n_states();
        let Some(engine) = self.simulator.steps() else { return Vec::new() };
        let answer = |call: &Call| {
            let mut next = vec![f64::NAN; call.count * call.samples() * width];
            self::call(engine, &call.rows(), &call.span, &mut next).map(|()| next)
        };
        let [(_, first), rest @ ..] = calls else { return Vec::new() };
        if rest.is_empty() {
            return vec![answer(first)];
        }
        let all = Call {
            count: calls.iter().map(|(_, call)| call.count).sum(),
            parts: std::array::from_fn(|part| calls.iter().flat_map(|(_, call)| &call.parts[part]).copied().collect()),
            span: match first.span {
                Span::Rollout(samples, count) => Span::Rollout(samples, count),
                Span::Each(_) => Span::Each(calls.iter().flat_map(|(_, call)| call.lengths()).copied().collect()),
            },
        };
        let Ok(next) = answer(&all) else { return calls.iter().map(|(_, call)| answer(call)).collect() };
        let mut rest = &next[..];
        let own = |(_, call): &(usize, Call)| {
            let (own, later) = rest.split_at(call.count * call.samples() * width);
            rest = later;
            Ok(own.to_vec())
        };
        calls.iter().map(own).collect()
    }
}

impl Call {
    fn rows(&self) -> Rows<'_> {
        let [states, commands, forces, parameters] = &self.parts;
        Rows { count: self.count, states, commands, forces, parameters }
    }

    fn samples(&self) -> usize {
        if let Span::Rollout(samples, _) = self.span { samples } else { 1 }
    }

    fn lengths(&self) -> &[f64] {
        if let Span::Each(lengths) = &self.span { lengths } else { &[] }
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::model::stepping::Stepping;

    /// Places after so many steps, each by a call of one row.
    fn steps(engine: &dyn Steps, count: usize, command: f64) -> Result<Vec<f64>> {
        let mut x = vec![0.0, 0.1];
        for step in 0..count {
            let mut next = vec![f64::NAN; 2];
            let rows = Rows { count: 1, states: &x, commands: &[command], forces: &[], parameters: &[0.03] };
            let span =
                if step % 3 == 2 { Span::Rollout(1, 2) } else { Span::Each(vec![0.001 * (step % 2 + 1) as f64]) };
            advance(engine, &rows, span, &mut next)?;
            x = next;
        }
        Ok(x)
    }

    #[test]
    fn tasks_get_what_they_get_alone_in_a_fraction_of_the_calls() {
        let simulator = Arc::new(Stepping::servo());
        let engine: &dyn Steps = &*simulator;
        let of = |item: usize| steps(engine, 20 + item % 7, 0.01 * item as f64);
        let alone: Vec<Vec<f64>> = (0..40).map(|item| of(item).unwrap()).collect();
        let apart = simulator.calls();
        let shared: Arc<dyn Dynamics> = simulator.clone();
        assert_eq!(together(&shared, (0..40).collect(), of).unwrap(), alone);
        let calls = simulator.calls() - apart;
        // Sixteen seats, two kinds of calls in a round, and the last items have the table for themselves.
        assert!(4 * calls < apart, "{calls} of {apart}");
    }

    #[test]
    fn an_error_ends_the_tasks_and_a_panic_leaves_none_waiting() {
        let simulator = Arc::new(Stepping::servo());
        let shared: Arc<dyn Dynamics> = simulator.clone();
        let failing = |item: usize| {
            steps(&*simulator, 5, 0.0)?;
            if item == 3 { Err(Error::Cancelled) } else { Ok(item) }
        };
        assert!(matches!(together(&shared, (0..200).collect(), failing), Err(Error::Cancelled)));
        let panicking = |item: usize| {
            assert!(item != 3, "as it should");
            steps(&*simulator, 5, 0.0)
        };
        let caught =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| together(&shared, (0..8).collect(), panicking)));
        assert!(caught.is_err());
    }
}
