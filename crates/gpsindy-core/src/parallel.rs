//! Independent tasks: on all processors with the feature `parallel`, one after another without it, with the same results.

#[cfg(feature = "parallel")]
pub(crate) use rayon::prelude::*;
#[cfg(not(feature = "parallel"))]
pub(crate) use serial::*;

/// The two words of rayon that this crate uses, as ordinary iterators.
#[cfg(not(feature = "parallel"))]
mod serial {
    pub(crate) trait IntoParallelIterator: IntoIterator + Sized {
        fn into_par_iter(self) -> Self::IntoIter {
            self.into_iter()
        }
    }

    impl<I: IntoIterator> IntoParallelIterator for I {}

    pub(crate) trait ParallelSlice<T> {
        fn par_iter(&self) -> std::slice::Iter<'_, T>;
    }

    impl<T> ParallelSlice<T> for [T] {
        fn par_iter(&self) -> std::slice::Iter<'_, T> {
            self.iter()
        }
    }
}
