//! Tasks side by side whose calls of one simulator go together.
//!
//! A call of a simulator in another language costs as much as many of its steps, and a fit needs thousands of calls of a few rows each.
//! So each task has a thread of its own, and once all threads wait for the simulator, one call answers them all. What a task gets does not
//! depend on the others. Nor does the order of the rows depend on the threads' pace: a simulator whose solver starts from its last solution
//! gives the same numbers every time.

use super::{Dynamics, Rows, Steps};
use crate::error::{Error, Result};
use std::cell::RefCell;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

/// Rows of a call at which its steps cost more than itself, with most simulators: tasks side by side are to fill it.
const FULL: usize = 32;

/// Tasks side by side, at most and at least. Each of them ends its step where time is up, and as many steps are then still to be made.
const MOST: usize = 16;
const LEAST: usize = 2;

thread_local! {
    /// The worker on this thread, where it is one of a batch.
    static WORKER: RefCell<Option<Worker>> = const { RefCell::new(None) };
}

/// How long the rows of a call go on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Span<'a> {
    /// A step of so many seconds for each row.
    Each(&'a [f64]),
    /// So many commands and forces one after another, each held for so many whole steps.
    Rollout(usize, usize),
}

/// A call that waits for the others.
#[derive(Debug)]
struct Call {
    count: usize,
    /// States, commands, forces and parameters, row after row.
    parts: [Vec<f64>; 4],
    /// How often commands and forces change, and for how many steps each of them is held; none where each row makes one step.
    rollout: Option<(usize, usize)>,
    /// Lengths of the steps, s, one a row, without a rollout.
    lengths: Vec<f64>,
}

/// What a worker waits for.
#[derive(Debug)]
enum Request {
    /// Nothing: it computes.
    Computing,
    /// Another item.
    Item,
    Call(Call),
    /// Nothing any more.
    Ended,
}

/// What a worker gets.
#[derive(Debug)]
enum Response {
    /// The number of its item, and none where all are given away.
    Item(Option<usize>),
    Call(Result<Vec<f64>>),
}

/// Tasks under way, and the simulator whose calls they share.
struct Batch {
    simulator: Arc<dyn Dynamics>,
    requests: Mutex<Requests>,
    /// One a worker: threads that wait at one place are woken in vain.
    mailboxes: Vec<(Mutex<Option<Response>>, Condvar)>,
}

/// What every worker waits for.
struct Requests {
    all: Vec<Request>,
    /// The next item, and how many there are.
    next: usize,
    count: usize,
}

/// A thread of the batch; it has ended when dropped, so that no one waits for a task that panicked.
struct Worker {
    batch: Arc<Batch>,
    number: usize,
}

/// Calls that are being answered; a panic of the simulator leaves no one without an answer.
struct Pending<'a> {
    batch: &'a Batch,
    workers: Vec<usize>,
}

/// `one` of every item, in their order, by threads whose calls of the simulator go together; each calls it for so many `rows`.
pub(crate) fn batched<T: Send, R: Send>(
    simulator: &Arc<dyn Dynamics>,
    rows: usize,
    items: Vec<T>,
    one: impl Fn(T) -> Result<R> + Send + Sync,
) -> Result<Vec<R>> {
    let count = items.len();
    let is_serial = count < 2 || cfg!(not(feature = "parallel")) || WORKER.with_borrow(Option::is_some);
    if is_serial {
        return items.into_iter().map(one).collect();
    }
    let threads = 0..count.min((FULL / rows.max(1)).clamp(LEAST, MOST));
    let all = threads.clone().map(|_| Request::Computing).collect();
    let batch = Arc::new(Batch {
        simulator: simulator.clone(),
        requests: Mutex::new(Requests { all, next: 0, count }),
        mailboxes: threads.clone().map(|_| Default::default()).collect(),
    });
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    let found: Vec<Mutex<Option<Result<R>>>> = (0..count).map(|_| Mutex::new(None)).collect();
    std::thread::scope(|scope| {
        for number in threads {
            let worker = Worker { batch: batch.clone(), number };
            let (batch, items, found, one) = (&batch, &items, &found, &one);
            scope.spawn(move || {
                WORKER.set(Some(worker));
                while let Some(next) = WORKER.with_borrow(|worker| worker.as_ref().and_then(Worker::next)) {
                    let item = lock(&items[next]).take();
                    let done = item.map(one);
                    if matches!(done, Some(Err(_))) {
                        batch.end();
                    }
                    *lock(&found[next]) = done;
                }
                WORKER.set(None);
            });
        }
    });
    found.into_iter().filter_map(|found| found.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// States `next` after `span`, in one call with what other tasks wait for where this thread's task is one of several.
pub(crate) fn advance(engine: &dyn Steps, rows: &Rows<'_>, span: Span<'_>, next: &mut [f64]) -> Result<()> {
    WORKER.with_borrow(|worker| match worker {
        Some(worker) if worker.batch.is_for(engine) => {
            let parts = [rows.states, rows.commands, rows.forces, rows.parameters].map(<[f64]>::to_vec);
            let (rollout, lengths) = match span {
                Span::Each(lengths) => (None, lengths.to_vec()),
                Span::Rollout(samples, count) => (Some((samples, count)), Vec::new()),
            };
            let call = Call { count: rows.count, parts, rollout, lengths };
            worker.answer(call).map(|answer| next.copy_from_slice(&answer))
        }
        _ => call(engine, rows, span, next),
    })
}

fn call(engine: &dyn Steps, rows: &Rows<'_>, span: Span<'_>, next: &mut [f64]) -> Result<()> {
    match span {
        Span::Rollout(samples, count) => engine.rollout(rows, (samples, count), next),
        Span::Each(dt) => match dt {
            [first, rest @ ..] if rest.iter().any(|other| other != first) => engine.unequal_steps(rows, dt, next),
            [first, ..] => engine.step(rows, *first, next),
            [] => Ok(()),
        },
    }
}

impl Worker {
    /// The number of the next item; none where there is none left.
    fn next(&self) -> Option<usize> {
        match self.wait(Request::Item) {
            Response::Item(next) => next,
            Response::Call(_) => None,
        }
    }

    fn answer(&self, call: Call) -> Result<Vec<f64>> {
        match self.wait(Request::Call(call)) {
            Response::Call(answer) => answer,
            Response::Item(_) => Err(Error::Cancelled),
        }
    }

    /// Waits for what this worker wants; the last to ask serves all.
    fn wait(&self, request: Request) -> Response {
        self.batch.request(self.number, request);
        let (mailbox, has_come) = &self.batch.mailboxes[self.number];
        let mut response = lock(mailbox);
        loop {
            match response.take() {
                Some(own) => return own,
                None => response = has_come.wait(response).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.batch.request(self.number, Request::Ended);
    }
}

impl Drop for Pending<'_> {
    fn drop(&mut self) {
        self.workers.iter().for_each(|&worker| self.batch.respond(worker, Response::Call(Err(Error::Cancelled))));
    }
}

impl Batch {
    fn is_for(&self, engine: &dyn Steps) -> bool {
        self.simulator.steps().is_some_and(|own| std::ptr::addr_eq(own, engine))
    }

    /// Gives no more items away.
    fn end(&self) {
        let mut requests = lock(&self.requests);
        requests.next = requests.count;
    }

    /// Notes what a worker wants, and answers all once no one computes.
    fn request(&self, worker: usize, request: Request) {
        let mut requests = lock(&self.requests);
        requests.all[worker] = request;
        if requests.all.iter().any(|request| matches!(request, Request::Computing)) {
            return;
        }
        let Requests { all, next, count } = &mut *requests;
        let (mut items, mut calls) = (Vec::new(), Vec::new());
        for (worker, request) in all.iter_mut().enumerate() {
            match std::mem::replace(request, Request::Computing) {
                Request::Item => {
                    items.push((worker, (*next < *count).then_some(*next)));
                    *next += 1;
                }
                Request::Call(call) => calls.push((worker, call)),
                Request::Ended | Request::Computing => *request = Request::Ended,
            }
        }
        // Whoever gets something goes on at once, and may ask again before all are answered.
        drop(requests);
        items.into_iter().for_each(|(worker, item)| self.respond(worker, Response::Item(item)));
        let mut pending = Pending { batch: self, workers: calls.iter().map(|(worker, _)| *worker).collect() };
        calls.sort_by_key(|(worker, call)| (call.rollout, *worker));
        for same in calls.chunk_by(|a, b| a.1.rollout == b.1.rollout) {
            for ((worker, _), answer) in same.iter().zip(self.answers(same)) {
                pending.workers.retain(|other| other != worker);
                self.respond(*worker, Response::Call(answer));
            }
        }
    }

    fn respond(&self, worker: usize, response: Response) {
        let (mailbox, has_come) = &self.mailboxes[worker];
        *lock(mailbox) = Some(response);
        has_come.notify_one();
    }

    /// What each of some calls of one kind gets: by one call, and where that fails each by its own.
    fn answers(&self, calls: &[(usize, Call)]) -> Vec<Result<Vec<f64>>> {
        let width = self.simulator.n_states();
        let Some(engine) = self.simulator.steps() else { return Vec::new() };
        let answer = |call: &Call| {
            let mut next = vec![f64::NAN; call.count * call.samples() * width];
            self::call(engine, &call.rows(), call.span(), &mut next).map(|()| next)
        };
        let [(_, first), rest @ ..] = calls else { return Vec::new() };
        if rest.is_empty() {
            return vec![answer(first)];
        }
        let all = Call {
            count: calls.iter().map(|(_, call)| call.count).sum(),
            parts: std::array::from_fn(|part| calls.iter().flat_map(|(_, call)| &call.parts[part]).copied().collect()),
            rollout: first.rollout,
            lengths: calls.iter().flat_map(|(_, call)| &call.lengths).copied().collect(),
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
        self.rollout.map_or(1, |(samples, _)| samples)
    }

    fn span(&self) -> Span<'_> {
        self.rollout.map_or(Span::Each(&self.lengths), |(samples, count)| Span::Rollout(samples, count))
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
            let length = [0.001 * (step % 2 + 1) as f64];
            let span = if step % 3 == 2 { Span::Rollout(1, 2) } else { Span::Each(&length) };
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
        assert_eq!(batched(&shared, 1, (0..40).collect(), of).unwrap(), alone);
        let calls = simulator.calls() - apart;
        // Sixteen workers, two kinds of calls in a round, and the last items are alone.
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
        assert!(matches!(batched(&shared, 1, (0..200).collect(), failing), Err(Error::Cancelled)));
        let panicking = |item: usize| {
            assert!(item != 3, "as it should");
            steps(&*simulator, 5, 0.0)
        };
        let caught =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| batched(&shared, 1, (0..8).collect(), panicking)));
        assert!(caught.is_err());
    }
}
