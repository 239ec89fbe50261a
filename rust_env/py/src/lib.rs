//! `innerattn._core`: batches of rescue worlds over numpy arrays, and the planner. Checks every argument at
//! the door, releases the GIL while worlds step and plans are made, and knows no rule of the worlds itself.

mod arrays;
mod batch;
mod dispatch;
mod door;
mod instance;
mod orders;
mod routes;
mod rules;

/// rapier makes and frees hundreds of small things a period, which this does faster than the system.
/// The address sanitizer must know every piece of memory, and knows those of the system.
#[cfg(not(asan))]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

use innerattn_env::error::Error;
use innerattn_env::fault::SPECS;
use innerattn_env::reward::COMPONENTS;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// The exception for an error of the worlds.
fn raised(py: Python, error: &Error) -> PyErr {
    let text = error.to_string();
    match error {
        Error::Panicked { envs, .. } => {
            let class = py.import("innerattn.errors").and_then(|module| module.getattr("WorldError"));
            match class.and_then(|class| class.call1((text, envs.clone()))) {
                Ok(exception) => PyErr::from_value(exception),
                Err(error) => error,
            }
        }
        _ => PyValueError::new_err(text),
    }
}

/// Name, unit, least, most and healthy value, and meaning of each kind of fault, in the order of levels.
fn fault_kinds(py: Python) -> PyResult<Bound<PyTuple>> {
    let rows = SPECS.iter().map(|spec| {
        let (low, high) = spec.range;
        (spec.name, spec.unit, low, high, spec.healthy, spec.meaning)
    });
    PyTuple::new(py, rows.collect::<Vec<_>>())
}

/// Name and meaning of each reward component, in the order of their columns.
fn reward_components(py: Python) -> PyResult<Bound<PyTuple>> {
    let rows = COMPONENTS.iter().map(|component| (component.name, component.meaning));
    PyTuple::new(py, rows.collect::<Vec<_>>())
}

/// The compiled half of innerattn.
#[pymodule]
fn _core(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("ORDER_FEATURES", innerattn_planner::choice::FEATURES)?;
    module.add("FAULT_KINDS", fault_kinds(module.py())?)?;
    module.add("REWARD_COMPONENTS", reward_components(module.py())?)?;
    module.add_class::<rules::Rules>()?;
    module.add_class::<dispatch::Dispatcher>()?;
    module.add_class::<instance::Instance>()?;
    module.add_class::<orders::Orders>()?;
    module.add_class::<routes::Routes>()?;
    module.add_class::<batch::Batch>()
}
