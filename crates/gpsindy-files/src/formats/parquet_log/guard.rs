//! Decoding of bytes that may be broken.
//!
//! The `parquet` crate (60.1) ends with an error where a file is cut, and panics in its decoders of levels and runs where bytes
//! of a page are other ones. A panic while a file is decoded is therefore the file's fault, and becomes an error.

use parquet::errors::ParquetError;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Installs, once, a hook that says nothing of panics while a file is decoded, and all others to the hook before.
static HOOK: Once = Once::new();

/// What `work` returns, or an error where it panics. What it wrote to outside itself is to be dropped then.
pub(super) fn guarded<T>(work: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, ParquetError> {
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !DECODING.get() {
                before(info);
            }
        }));
    });
    let outer = DECODING.replace(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    DECODING.set(outer);
    result.unwrap_or_else(|cause| {
        let message = cause.downcast_ref::<String>().cloned();
        let message = message.or_else(|| cause.downcast_ref::<&str>().map(|text| (*text).to_string()));
        Err(ParquetError::General(message.unwrap_or_else(|| "a page that can't be decoded".into())))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_and_a_result_stays() {
        let length = |bytes: &[u8]| bytes.len();
        assert_eq!(guarded(|| Ok(length(b"abc"))).unwrap(), 3);
        let error = guarded(|| Ok([1, 2, 3][length(b"abc")])).unwrap_err().to_string();
        assert!(error.contains("index out of bounds"), "{error}");
        let error = guarded(|| -> Result<(), _> { panic!("a wrong level") }).unwrap_err().to_string();
        assert!(error.contains("a wrong level") && !DECODING.get(), "{error}");
    }
}
