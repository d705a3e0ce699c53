//! The C functions of MuJoCo's batches: simulations of one model, each a row of its state, which errors of the engine do not leave.

#![allow(unsafe_code, reason = "the functions of MuJoCo are C")]

use crate::native::foreign::Function;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::HashMap;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ops::Range;
use std::ptr::{self, NonNull};
use std::slice;
use std::sync::Arc;

type Handle = *mut c_void;

/// `mjBatchConfig`.
#[repr(C)]
struct Config {
    nthread: c_int,
    persistent: bool,
}

/// `mjWarningStat`.
#[repr(C)]
struct Warning {
    last: c_int,
    number: c_int,
}

/// `mjSTAGE_NONE`: nothing is computed at the new state.
const NO_STAGE: c_int = 0;

/// Longest message of an error.
const LONGEST: usize = 500;

type Make = unsafe extern "C" fn(*const c_void, c_int, *const Config, *mut c_char, c_int) -> Handle;
type Delete = unsafe extern "C" fn(Handle);
type Count = unsafe extern "C" fn(Handle) -> c_int;
type State = unsafe extern "C" fn(Handle) -> *mut f64;
type Component = unsafe extern "C" fn(Handle, c_int, *mut c_int) -> *mut f64;
type Warnings = unsafe extern "C" fn(Handle) -> *mut Warning;
type Step = unsafe extern "C" fn(Handle, *const c_int, c_int, c_int, c_int) -> c_int;
type Expand = unsafe extern "C" fn(Handle, *const c_char, *mut c_int, *mut c_int) -> *mut c_void;
type SetConstants = unsafe extern "C" fn(Handle, *const c_int, c_int) -> c_int;
type Message = unsafe extern "C" fn(Handle, c_int) -> *const c_char;

/// The functions of the library.
#[derive(Clone, Copy)]
pub(super) struct Library {
    make: Make,
    delete: Delete,
    state_size: Count,
    state: State,
    component: Component,
    warnings: Warnings,
    step: Step,
    expand: Expand,
    set_constants: SetConstants,
    message: Message,
}

/// Simulations of one model.
pub(super) struct Batch {
    library: Arc<Library>,
    handle: NonNull<c_void>,
    simulations: usize,
    /// Values of a state.
    size: usize,
    /// Values of model fields that each simulation has of its own: where they are, and how many.
    fields: HashMap<CString, (NonNull<f64>, usize)>,
}

// SAFETY: a batch of one thread keeps nothing of the thread that calls it, and `&mut self` of every call forbids two at once.
unsafe impl Send for Batch {}

impl Library {
    /// The functions of a library of ctypes.
    pub(super) fn of(library: &Bound<'_, PyAny>) -> PyResult<Self> {
        // SAFETY: each name has the type that mjbatch.h gives it.
        unsafe {
            Ok(Self {
                make: found(Function::of(library, "mjb_makeBatch")?)?,
                delete: found(Function::of(library, "mjb_deleteBatch")?)?,
                state_size: found(Function::of(library, "mjb_nstate")?)?,
                state: found(Function::of(library, "mjb_state")?)?,
                component: found(Function::of(library, "mjb_stateComponent")?)?,
                warnings: found(Function::of(library, "mjb_warning")?)?,
                step: found(Function::of(library, "mjb_step")?)?,
                expand: found(Function::of(library, "mjb_expand")?)?,
                set_constants: found(Function::of(library, "mjb_setConst")?)?,
                message: found(Function::of(library, "mjb_error")?)?,
            })
        }
    }
}

fn found<F>(function: Function<F>) -> PyResult<F> {
    let missing = || {
        let name = function.name;
        PyValueError::new_err(format!(
            "MuJoCo's library has no function {name}; gpsindy needs the package mujoco, 4 or newer"
        ))
    };
    function.pointer.ok_or_else(missing)
}

impl Batch {
    /// So many simulations of the model at an address, of which the batch makes a copy; warnings are counted and not printed, of which
    /// there are `warnings` kinds.
    pub(super) fn new(library: Arc<Library>, model: usize, simulations: usize, warnings: usize) -> PyResult<Self> {
        let model = ptr::with_exposed_provenance::<c_void>(model);
        let config = Config { nthread: 1, persistent: false };
        let mut message: [c_char; LONGEST] = [0; LONGEST];
        // SAFETY: the address is that of a model which Python holds, and the message has its length.
        let handle = unsafe {
            (library.make)(model, simulations as c_int, &raw const config, message.as_mut_ptr(), LONGEST as c_int)
        };
        let Some(handle) = NonNull::new(handle) else {
            // SAFETY: the function ends what it writes, and the array began as zeros.
            let message = unsafe { CStr::from_ptr(message.as_ptr()) }.to_string_lossy().into_owned();
            return Err(PyValueError::new_err(format!("MuJoCo made no copies of the model: {message}")));
        };
        // SAFETY: the handle is of this library.
        let size = unsafe { (library.state_size)(handle.as_ptr()) } as usize;
        let mut batch = Self { library, handle, simulations, size, fields: HashMap::new() };
        batch.hush(warnings);
        Ok(batch)
    }

    /// The engine prints a warning when it is the first of its kind and leaves a file. Trial parameters that diverge are part of a search,
    /// and their states show them.
    fn hush(&mut self, kinds: usize) {
        // SAFETY: there are as many counters of every simulation.
        let counters = unsafe {
            let first = (self.library.warnings)(self.handle.as_ptr());
            if first.is_null() { &mut [] } else { slice::from_raw_parts_mut(first, self.simulations * kinds) }
        };
        counters.iter_mut().for_each(|counter| (counter.last, counter.number) = (0, 1));
    }

    /// Places of a component of the state, one bit of `mjtState`.
    pub(super) fn component(&mut self, bit: c_int) -> Range<usize> {
        let mut size = 0;
        // SAFETY: the handle is of this library; both addresses are in the first row, the end of which a component does not pass.
        unsafe {
            let address = (self.library.component)(self.handle.as_ptr(), bit, &raw mut size);
            if address.is_null() || size <= 0 {
                return 0..0;
            }
            let first = address.offset_from((self.library.state)(self.handle.as_ptr())) as usize;
            first..first + size as usize
        }
    }

    /// State of a simulation.
    pub(super) fn state(&mut self, simulation: usize) -> &mut [f64] {
        assert!(simulation < self.simulations, "a simulation of this batch");
        // SAFETY: the row is within the states of all simulations.
        unsafe {
            let first = (self.library.state)(self.handle.as_ptr());
            slice::from_raw_parts_mut(first.add(simulation * self.size), self.size)
        }
    }

    /// Values of a simulation's own of a field of the model.
    pub(super) fn field(&mut self, name: &CStr, simulation: usize) -> PyResult<&mut [f64]> {
        assert!(simulation < self.simulations, "a simulation of this batch");
        if !self.fields.contains_key(name) {
            let (mut size, mut bytes) = (0, 0);
            // SAFETY: the handle is of this library, and the name ends.
            let first =
                unsafe { (self.library.expand)(self.handle.as_ptr(), name.as_ptr(), &raw mut size, &raw mut bytes) };
            let first = NonNull::new(first.cast::<f64>()).filter(|_| bytes as usize == size_of::<f64>() && size > 0);
            let first = first.ok_or_else(|| {
                PyValueError::new_err(format!(
                    "MuJoCo has no numbers of double precision called {}",
                    name.to_string_lossy()
                ))
            })?;
            self.fields.insert(name.into(), (first, size as usize));
        }
        let (first, size) = self.fields[name];
        // SAFETY: the library keeps so many values of every simulation as long as the batch.
        Ok(unsafe { slice::from_raw_parts_mut(first.as_ptr().add(simulation * size), size) })
    }

    /// Computes the constants of a simulation's model that depend on its fields.
    pub(super) fn set_constants(&mut self, simulation: usize) -> PyResult<()> {
        let which = simulation as c_int;
        // SAFETY: the handle is of this library, and there is one number.
        let failed = unsafe { (self.library.set_constants)(self.handle.as_ptr(), &raw const which, 1) };
        if failed == 0 { Ok(()) } else { Err(PyValueError::new_err(format!("MuJoCo: {}", self.message(simulation)))) }
    }

    /// So many steps of a simulation; whether the engine made them. Where it did not, the state is as before.
    pub(super) fn step(&mut self, simulation: usize, count: usize) -> bool {
        let which = simulation as c_int;
        // SAFETY: the handle is of this library, and there is one number.
        unsafe { (self.library.step)(self.handle.as_ptr(), &raw const which, 1, count as c_int, NO_STAGE) == 0 }
    }

    /// What the engine said of a simulation's last call.
    fn message(&self, simulation: usize) -> String {
        // SAFETY: the handle is of this library, which keeps the text until the next call.
        unsafe {
            let text = (self.library.message)(self.handle.as_ptr(), simulation as c_int);
            if text.is_null() { String::new() } else { CStr::from_ptr(text).to_string_lossy().into_owned() }
        }
    }
}

impl Drop for Batch {
    fn drop(&mut self) {
        // SAFETY: the handle is of this library and not used again.
        unsafe { (self.library.delete)(self.handle.as_ptr()) }
    }
}
