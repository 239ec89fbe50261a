//! `innerattn._core`: batches of rescue worlds over numpy arrays. Checks every argument at the door,
//! releases the GIL while worlds step, and knows no rule of the worlds itself.

mod arrays;
mod batch;
mod rules;

/// rapier makes and frees hundreds of small things a period, which this does faster than the system.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

use innerattn_env::error::Error;
use innerattn_env::fault::SPECS;
use innerattn_env::reward::COMPONENTS;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

fn value_error(error: &Error) -> PyErr {
    PyValueError::new_err(error.to_string())
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
    module.add("FAULT_KINDS", fault_kinds(module.py())?)?;
    module.add("REWARD_COMPONENTS", reward_components(module.py())?)?;
    module.add_class::<rules::Rules>()?;
    module.add_class::<batch::Batch>()
}
