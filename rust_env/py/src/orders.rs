//! `_core.Orders`: orders of the tasks of instances, made task by task, many at a time.

use std::sync::Arc;

use innerattn_planner::choice::{FEATURES, Unfinished};
use innerattn_planner::instance::Instance as Valid;
use numpy::{PyArray1, PyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::door::Door;
use crate::instance::Instance;

/// What comes next in an order that has all tasks.
const NONE: i64 = -1;

/// Orders under way, one for each instance given.
#[pyclass(module = "innerattn._core")]
pub struct Orders {
    all: Vec<(Arc<Valid>, Unfinished)>,
    tasks: usize,
}

#[pymethods]
impl Orders {
    #[new]
    #[allow(clippy::needless_pass_by_value)] // Python gives a list of its own
    fn new(instances: Vec<PyRef<Instance>>) -> PyResult<Self> {
        let begun = |instance: &PyRef<Instance>| (instance.0.clone(), Unfinished::new(&instance.0));
        let all: Vec<_> = instances.iter().map(begun).collect();
        let Some(tasks) = all.iter().map(|(instance, _)| instance.tasks.len()).max() else {
            return Err(PyValueError::new_err("instances: there are 0: must be 1 or more"));
        };
        Ok(Self { all, tasks })
    }

    fn features<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyArray3<f32>> {
        let rows = self.tasks * FEATURES;
        let mut written = vec![0.0; self.all.len() * rows];
        py.detach(|| {
            for ((instance, order), rows) in self.all.iter_mut().zip(written.chunks_exact_mut(rows)) {
                order.features(instance, &mut rows[..instance.tasks.len() * FEATURES]);
            }
        });
        let shape = [self.all.len(), self.tasks, FEATURES];
        let array =
            numpy::ndarray::Array3::from_shape_vec(shape, written).expect("as many as the shape says");
        PyArray3::from_owned_array(py, array)
    }

    fn take(&mut self, tasks: &Bound<PyAny>) -> PyResult<()> {
        let mut chosen = vec![];
        Door::integers("tasks", &[self.all.len()]).read_i64(tasks, &mut chosen)?;
        for (row, ((_, order), task)) in self.all.iter().zip(&chosen).enumerate() {
            let open = order.open();
            let allowed = match usize::try_from(*task) {
                Ok(task) => open.binary_search(&task).is_ok(),
                Err(_) => *task == NONE && open.is_empty(),
            };
            if !allowed {
                let rule = format!("must be a task that is not in the order yet, {NONE} if there is none");
                return Err(PyValueError::new_err(format!("tasks[{row}] = {task}: {rule}")));
            }
        }
        for ((instance, order), task) in self.all.iter_mut().zip(&chosen) {
            if let Ok(task) = usize::try_from(*task) {
                order.take(instance, task);
            }
        }
        Ok(())
    }

    fn makespans<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.all.iter().map(|(_, order)| order.makespan()))
    }

    fn orders(&self) -> Vec<Vec<usize>> {
        self.all.iter().map(|(_, order)| order.order().to_vec()).collect()
    }
}
