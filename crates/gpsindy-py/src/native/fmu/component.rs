//! The C functions of one FMU instance, those of FMI 2 and FMI 3 behind the same words.

#![allow(unsafe_code, reason = "the functions of an FMU are C")]

use super::failure::Failure;
use crate::native::foreign::Function;
use pyo3::prelude::*;
use std::ffi::{c_int, c_uint, c_void};
use std::ptr;

type Handle = *mut c_void;
type Status = c_int;
type Plain = unsafe extern "C" fn(Handle) -> Status;
type SetTime = unsafe extern "C" fn(Handle, f64) -> Status;
type Put = unsafe extern "C" fn(Handle, *const f64, usize) -> Status;
type Take = unsafe extern "C" fn(Handle, *mut f64, usize) -> Status;

/// `fmi2Warning` and `fmi3Warning`: above it nothing that the function left may be used.
const WARNING: Status = 1;

/// `fmi2EventInfo`.
#[repr(C)]
#[derive(Default)]
struct EventInfo {
    new_discrete_states_needed: c_int,
    terminate_simulation: c_int,
    nominals_changed: c_int,
    values_changed: c_int,
    next_event_time_defined: c_int,
    next_event_time: f64,
}

/// What an update of the discrete states says.
pub(super) struct Event {
    /// It must be repeated.
    pub(super) again: bool,
    /// There will be an event at a time that is known now.
    pub(super) timed: bool,
}

impl<F: Copy> Function<F> {
    /// Calls the function where there is one; the same statuses are errors as in fmpy.
    fn call(&self, call: impl FnOnce(F) -> Status) -> Result<(), Failure> {
        let status = call(self.pointer.ok_or(Failure::Missing(self.name))?);
        if status > WARNING { Err(Failure::Status { function: self.name, status }) } else { Ok(()) }
    }
}

/// The functions that differ between the versions of FMI in more than their names.
enum Version {
    Two {
        setup_experiment: Function<unsafe extern "C" fn(Handle, c_int, f64, f64, c_int, f64) -> Status>,
        enter_initialization: Function<Plain>,
        set: Function<unsafe extern "C" fn(Handle, *const c_uint, usize, *const f64) -> Status>,
        get: Function<unsafe extern "C" fn(Handle, *const c_uint, usize, *mut f64) -> Status>,
        update_discrete_states: Function<unsafe extern "C" fn(Handle, *mut EventInfo) -> Status>,
        do_step: Function<unsafe extern "C" fn(Handle, f64, f64, c_int) -> Status>,
    },
    Three {
        enter_initialization: Function<unsafe extern "C" fn(Handle, bool, f64, f64, bool, f64) -> Status>,
        set: Function<unsafe extern "C" fn(Handle, *const c_uint, usize, *const f64, usize) -> Status>,
        get: Function<unsafe extern "C" fn(Handle, *const c_uint, usize, *mut f64, usize) -> Status>,
        // A byte in place of a Boolean: what C leaves there need be neither 0 nor 1.
        update_discrete_states:
            Function<unsafe extern "C" fn(Handle, *mut u8, *mut u8, *mut u8, *mut u8, *mut u8, *mut f64) -> Status>,
        do_step: Function<unsafe extern "C" fn(Handle, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) -> Status>,
    },
}

/// An instance of an FMU and the functions of its library.
pub(super) struct Component {
    /// The instance of fmpy, which holds library and callbacks.
    fmu: Py<PyAny>,
    handle: Handle,
    version: Version,
    exit_initialization: Function<Plain>,
    reset: Function<Plain>,
    enter_event_mode: Function<Plain>,
    enter_continuous_time_mode: Function<Plain>,
    set_time: Function<SetTime>,
    set_continuous_states: Function<Put>,
    get_continuous_states: Function<Take>,
    get_derivatives: Function<Take>,
    get_event_indicators: Function<Take>,
}

// SAFETY: FMI ties no instance to a thread, it only forbids two calls at once, which `&mut self` of every call does, too.
unsafe impl Send for Component {}

impl Component {
    /// The component of an instance of fmpy that was instantiated, of FMI 2 or, where not `two`, of FMI 3.
    pub(super) fn of(fmu: &Bound<'_, PyAny>, two: bool) -> PyResult<Self> {
        let library = fmu.getattr("dll")?;
        let handle = ptr::with_exposed_provenance_mut(fmu.getattr("component")?.extract::<usize>()?);
        let either = |second, third| if two { second } else { third };
        // SAFETY: each name has the type that the headers of FMI give it: fmi2FunctionTypes.h and fmi3FunctionTypes.h.
        unsafe {
            let version = if two {
                Version::Two {
                    setup_experiment: Function::of(&library, "fmi2SetupExperiment")?,
                    enter_initialization: Function::of(&library, "fmi2EnterInitializationMode")?,
                    set: Function::of(&library, "fmi2SetReal")?,
                    get: Function::of(&library, "fmi2GetReal")?,
                    update_discrete_states: Function::of(&library, "fmi2NewDiscreteStates")?,
                    do_step: Function::of(&library, "fmi2DoStep")?,
                }
            } else {
                Version::Three {
                    enter_initialization: Function::of(&library, "fmi3EnterInitializationMode")?,
                    set: Function::of(&library, "fmi3SetFloat64")?,
                    get: Function::of(&library, "fmi3GetFloat64")?,
                    update_discrete_states: Function::of(&library, "fmi3UpdateDiscreteStates")?,
                    do_step: Function::of(&library, "fmi3DoStep")?,
                }
            };
            let plain = |second, third| Function::<Plain>::of(&library, either(second, third));
            let take = |second, third| Function::<Take>::of(&library, either(second, third));
            let put = either("fmi2SetContinuousStates", "fmi3SetContinuousStates");
            Ok(Self {
                fmu: fmu.clone().unbind(),
                handle,
                version,
                exit_initialization: plain("fmi2ExitInitializationMode", "fmi3ExitInitializationMode")?,
                reset: plain("fmi2Reset", "fmi3Reset")?,
                enter_event_mode: plain("fmi2EnterEventMode", "fmi3EnterEventMode")?,
                enter_continuous_time_mode: plain("fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode")?,
                set_time: Function::of(&library, either("fmi2SetTime", "fmi3SetTime"))?,
                set_continuous_states: Function::of(&library, put)?,
                get_continuous_states: take("fmi2GetContinuousStates", "fmi3GetContinuousStates")?,
                get_derivatives: take("fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives")?,
                get_event_indicators: take("fmi2GetEventIndicators", "fmi3GetEventIndicators")?,
            })
        }
    }

    /// Frees instance and library, by fmpy.
    pub(super) fn free(self, py: Python<'_>) -> PyResult<()> {
        self.fmu.call_method0(py, "freeInstance").map(|_| ())
    }

    /// From the time 0.
    pub(super) fn setup_experiment(&mut self) -> Result<(), Failure> {
        match &self.version {
            // SAFETY: the handle is of this library.
            Version::Two { setup_experiment, .. } => {
                setup_experiment.call(|f| unsafe { f(self.handle, 0, 0.0, 0.0, 0, 0.0) })
            }
            // Said when initialisation begins.
            Version::Three { .. } => Ok(()),
        }
    }

    pub(super) fn enter_initialization(&mut self) -> Result<(), Failure> {
        match &self.version {
            Version::Two { enter_initialization, .. } => self.plain(enter_initialization),
            Version::Three { enter_initialization, .. } => {
                // SAFETY: the handle is of this library.
                enter_initialization.call(|f| unsafe { f(self.handle, false, 0.0, 0.0, false, 0.0) })
            }
        }
    }

    pub(super) fn exit_initialization(&mut self) -> Result<(), Failure> {
        self.plain(&self.exit_initialization)
    }

    pub(super) fn reset(&mut self) -> Result<(), Failure> {
        self.plain(&self.reset)
    }

    pub(super) fn enter_event_mode(&mut self) -> Result<(), Failure> {
        self.plain(&self.enter_event_mode)
    }

    pub(super) fn enter_continuous_time_mode(&mut self) -> Result<(), Failure> {
        self.plain(&self.enter_continuous_time_mode)
    }

    /// Values of real variables, one a reference.
    pub(super) fn set(&mut self, references: &[c_uint], values: &[f64]) -> Result<(), Failure> {
        let n = references.len().min(values.len());
        if n == 0 {
            return Ok(());
        }
        let (from, values) = (references.as_ptr(), values.as_ptr());
        match &self.version {
            // SAFETY: the handle is of this library, and both arrays have n elements.
            Version::Two { set, .. } => set.call(|f| unsafe { f(self.handle, from, n, values) }),
            // SAFETY: the same.
            Version::Three { set, .. } => set.call(|f| unsafe { f(self.handle, from, n, values, n) }),
        }
    }

    /// The same, read.
    pub(super) fn get(&mut self, references: &[c_uint], values: &mut [f64]) -> Result<(), Failure> {
        let n = references.len().min(values.len());
        let (from, values) = (references.as_ptr(), values.as_mut_ptr());
        match &self.version {
            // SAFETY: the handle is of this library, and both arrays have n elements.
            Version::Two { get, .. } => get.call(|f| unsafe { f(self.handle, from, n, values) }),
            // SAFETY: the same.
            Version::Three { get, .. } => get.call(|f| unsafe { f(self.handle, from, n, values, n) }),
        }
    }

    pub(super) fn set_time(&mut self, t: f64) -> Result<(), Failure> {
        // SAFETY: the handle is of this library.
        self.set_time.call(|f| unsafe { f(self.handle, t) })
    }

    /// All continuous states.
    pub(super) fn set_continuous_states(&mut self, x: &[f64]) -> Result<(), Failure> {
        // SAFETY: the handle is of this library, and the function gets the length of the array.
        self.set_continuous_states.call(|f| unsafe { f(self.handle, x.as_ptr(), x.len()) })
    }

    pub(super) fn get_continuous_states(&mut self, x: &mut [f64]) -> Result<(), Failure> {
        self.take(&self.get_continuous_states, x)
    }

    pub(super) fn get_derivatives(&mut self, dx: &mut [f64]) -> Result<(), Failure> {
        self.take(&self.get_derivatives, dx)
    }

    pub(super) fn get_event_indicators(&mut self, z: &mut [f64]) -> Result<(), Failure> {
        self.take(&self.get_event_indicators, z)
    }

    pub(super) fn update_discrete_states(&mut self) -> Result<Event, Failure> {
        match &self.version {
            Version::Two { update_discrete_states, .. } => {
                let mut info = EventInfo::default();
                // SAFETY: the handle is of this library, and the record has the layout of C.
                update_discrete_states.call(|f| unsafe { f(self.handle, &raw mut info) })?;
                Ok(Event { again: info.new_discrete_states_needed != 0, timed: info.next_event_time_defined != 0 })
            }
            Version::Three { update_discrete_states, .. } => {
                let (mut again, mut stop, mut nominals, mut values, mut timed, mut next) = (0, 0, 0, 0, 0, 0.0);
                // SAFETY: the handle is of this library, and each pointer is of a variable of its own.
                update_discrete_states.call(|f| unsafe {
                    f(self.handle, &mut again, &mut stop, &mut nominals, &mut values, &mut timed, &mut next)
                })?;
                Ok(Event { again: again != 0, timed: timed != 0 })
            }
        }
    }

    /// A step of co-simulation from the time 0 that is never taken back.
    pub(super) fn do_step(&mut self, dt: f64) -> Result<(), Failure> {
        match &self.version {
            // SAFETY: the handle is of this library.
            Version::Two { do_step, .. } => do_step.call(|f| unsafe { f(self.handle, 0.0, dt, 1) }),
            Version::Three { do_step, .. } => {
                let (mut event, mut stop, mut early, mut last) = (0, 0, 0, 0.0);
                // SAFETY: the handle is of this library, and each pointer is of a variable of its own.
                do_step.call(|f| unsafe { f(self.handle, 0.0, dt, true, &mut event, &mut stop, &mut early, &mut last) })
            }
        }
    }

    fn plain(&self, function: &Function<Plain>) -> Result<(), Failure> {
        // SAFETY: the handle is of this library.
        function.call(|f| unsafe { f(self.handle) })
    }

    fn take(&self, function: &Function<Take>, values: &mut [f64]) -> Result<(), Failure> {
        // SAFETY: the handle is of this library, and the function gets the length of the array.
        function.call(|f| unsafe { f(self.handle, values.as_mut_ptr(), values.len()) })
    }
}
