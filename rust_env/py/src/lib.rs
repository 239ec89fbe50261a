//! `innerattn._core`: batches of rescue worlds over numpy arrays. Checks every argument at the door,
//! releases the GIL while worlds step, and knows no rule of the worlds itself.

mod arrays;
mod batch;

/// rapier makes and frees hundreds of small things a period, which this does faster than the system.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

use innerattn_env::error::Error;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::Scenario;
use innerattn_env::world::check_room;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

fn value_error(error: &Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Checks a scenario in JSON and returns it with every key written out.
#[pyfunction]
fn check_scenario(py: Python, json: &str) -> PyResult<String> {
    let checked = py.detach(|| {
        let rules = Rules::new(Scenario::from_json(json)?)?;
        check_room(&rules)?;
        Ok(rules.scenario.to_json())
    });
    checked.map_err(|error: Error| value_error(&error))
}

/// The compiled half of innerattn.
#[pymodule]
fn _core(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(check_scenario, module)?)?;
    module.add_class::<batch::Batch>()
}
