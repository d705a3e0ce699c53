//! Independent tasks: on all processors with the feature `parallel`, one after another without it, with the same results.

use crate::error::Result;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// `task` of every item, in their order.
pub(crate) fn map<T: Send, R: Send>(items: impl IntoIterator<Item = T>, task: impl Fn(T) -> R + Sync) -> Vec<R> {
    let items: Vec<Mutex<Option<T>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    let results: Vec<Mutex<Option<R>>> = items.iter().map(|_| Mutex::new(None)).collect();
    side_by_side(items.len(), &|place| {
        let item = items[place].lock().unwrap_or_else(PoisonError::into_inner).take();
        let result = item.map(&task);
        *results[place].lock().unwrap_or_else(PoisonError::into_inner) = result;
    });
    results.into_iter().filter_map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// As [`map`], of tasks that may fail: the first error in the items' order of those that ran; what has not begun then is not begun.
pub(crate) fn try_map<T: Send, R: Send>(
    items: impl IntoIterator<Item = T>,
    task: impl Fn(T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let has_failed = AtomicBool::new(false);
    let results = map(items, |item| {
        if has_failed.load(Ordering::Relaxed) {
            return None;
        }
        let result = task(item);
        has_failed.fetch_or(result.is_err(), Ordering::Relaxed);
        Some(result)
    });
    results.into_iter().flatten().collect()
}

/// Calls `task` with every number below `count`. Not generic, so that the scheduler of rayon is compiled once and not for every task: it was
/// a twelfth of this crate's code.
#[cfg(feature = "parallel")]
fn side_by_side(count: usize, task: &(dyn Fn(usize) + Sync)) {
    use rayon::prelude::*;
    (0..count).into_par_iter().for_each(task);
}

#[cfg(not(feature = "parallel"))]
fn side_by_side(count: usize, task: &(dyn Fn(usize) + Sync)) {
    (0..count).for_each(task);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn results_come_in_the_order_of_the_items() {
        let squares: Vec<usize> = map(0..1000, |n| n * n);
        assert_eq!(squares, (0..1000).map(|n| n * n).collect::<Vec<_>>());
        assert_eq!(map(vec![String::from("owned")], |text| text + "!"), ["owned!"]);
        assert!(map(0..0, |n: usize| n).is_empty());
    }

    #[test]
    fn the_first_failure_ends_it() {
        let failed = try_map(0..1000, |n: usize| if n % 7 == 3 { Err(Error::Cancelled) } else { Ok(n) });
        assert!(matches!(failed, Err(Error::Cancelled)));
        assert_eq!(try_map(0..3, Ok).ok(), Some(vec![0, 1, 2]));
    }
}
