//! Functions of C libraries that are known when the program runs.

#![allow(unsafe_code, reason = "an address becomes a function")]

use pyo3::prelude::*;
use std::ffi::c_void;
use std::ptr;

/// A function, or its name alone where the library lacks it.
#[derive(Clone, Copy)]
pub(crate) struct Function<F> {
    pub(crate) name: &'static str,
    pub(crate) pointer: Option<F>,
}

impl<F: Copy> Function<F> {
    /// The function of that name in a library of ctypes.
    ///
    /// # Safety
    /// `F` is the type of the C function of that name.
    pub(crate) unsafe fn of(library: &Bound<'_, PyAny>, name: &'static str) -> PyResult<Self> {
        const { assert!(size_of::<F>() == size_of::<*const c_void>()) };
        let Some(function) = library.getattr_opt(name)? else {
            return Ok(Self { name, pointer: None });
        };
        let ctypes = library.py().import("ctypes")?;
        let pointer = ctypes.call_method1("cast", (function, ctypes.getattr("c_void_p")?))?.getattr("value")?;
        let address = ptr::with_exposed_provenance::<c_void>(pointer.extract::<usize>()?);
        // SAFETY: `F` is a type of function pointers as large as the address, and no function that ctypes found lies at zero.
        Ok(Self { name, pointer: Some(unsafe { std::mem::transmute_copy(&address) }) })
    }
}
