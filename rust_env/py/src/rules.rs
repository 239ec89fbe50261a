//! `_core.Rules`: a valid scenario as a Python object. Making one is the only way to check a scenario.

use std::sync::Arc;

use innerattn_env::blocks::Blocks;
use innerattn_env::rules::Rules as Shared;
use pyo3::prelude::*;

use crate::raised;

/// A scenario that was found valid, made ready to play.
#[pyclass(frozen, module = "innerattn._core")]
pub struct Rules(pub Arc<Shared>);

#[pymethods]
impl Rules {
    #[new]
    fn new(py: Python, json: &str) -> PyResult<Self> {
        let rules = py.detach(|| Shared::from_json(json)).map_err(|error| raised(py, &error))?;
        Ok(Self(Arc::new(rules)))
    }

    fn to_json(&self) -> String {
        self.0.scenario.to_json()
    }

    #[getter]
    fn num_victims(&self) -> usize {
        self.0.scenario.num_victims()
    }

    #[getter]
    fn max_helpers(&self) -> usize {
        self.0.scenario.max_helpers()
    }

    /// The boxes over the map's solid cells: centre and half extents of each, m.
    fn map_boxes(&self) -> Vec<[f32; 4]> {
        let blocks = self.0.blocks.iter().flat_map(Blocks::all);
        blocks
            .map(|(solid, at)| (solid.half_extents(), at))
            .map(|(half, at)| [at.x, at.y, half.x, half.y])
            .collect()
    }

    fn __eq__(&self, other: &Bound<PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| self.0.scenario == other.get().0.scenario)
    }

    /// Nothing in it can change: a copy is the same object.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<PyAny>) -> Py<Self> {
        slf
    }

    fn __getnewargs__(&self) -> (String,) {
        (self.to_json(),)
    }
}
