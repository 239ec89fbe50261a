//! `_core.Instance`: a valid instance of task allocation as a Python object. Making one is the only way to
//! check an instance.

use std::sync::{Arc, Mutex, PoisonError};

use innerattn_planner::error::Error;
use innerattn_planner::instance::{Instance as Valid, MAX_SKILLS, Robot, Task};
use innerattn_planner::order::schedule_of;
use innerattn_planner::schedule::{Schedule, simulate};
use innerattn_planner::search::{Limits, plan};
use innerattn_planner::simple::{greedy_order, random_schedule};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// An instance that was found valid.
#[pyclass(frozen, module = "innerattn._core")]
pub struct Instance(pub(crate) Arc<Valid>);

fn raised(error: &Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}

impl Instance {
    /// An order, if it has each task once.
    fn checked(&self, order: Vec<usize>) -> PyResult<Vec<usize>> {
        let mut tasks = order.clone();
        tasks.sort_unstable();
        if tasks.into_iter().eq(0..self.0.tasks.len()) {
            return Ok(order);
        }
        let last = self.0.tasks.len() - 1;
        Err(PyValueError::new_err(format!("order = {order:?}: must have each task from 0 to {last} once")))
    }
}

#[pymethods]
impl Instance {
    #[new]
    #[allow(clippy::type_complexity)]
    fn new(
        speed: f64,
        robots: Vec<([f64; 2], Vec<u8>)>,
        tasks: Vec<([f64; 2], Vec<u8>, f64)>,
    ) -> PyResult<Self> {
        let robot = |(index, (depot, skills)): (usize, ([f64; 2], Vec<u8>))| {
            if let Some(skill) = skills.iter().find(|skill| usize::from(**skill) >= MAX_SKILLS) {
                let rule = format!("must be 0 to {}", MAX_SKILLS - 1);
                return Err(PyValueError::new_err(format!("robots[{index}].skills = {skill}: {rule}")));
            }
            Ok(Robot { depot, skills: skills.iter().fold(0, |mask, skill| mask | 1 << skill) })
        };
        let robots = robots.into_iter().enumerate().map(robot).collect::<PyResult<_>>()?;
        let task = |(position, needs, duration)| Task { position, needs, duration };
        let tasks = tasks.into_iter().map(task).collect();
        Valid::new(speed, robots, tasks).map(|valid| Self(Arc::new(valid))).map_err(|error| raised(&error))
    }

    #[pyo3(signature = (seed, evaluations, seconds, order = None))]
    fn plan(
        &self,
        py: Python,
        seed: u64,
        evaluations: Option<u64>,
        seconds: Option<f64>,
        order: Option<Vec<usize>>,
    ) -> PyResult<(Schedule, u64)> {
        let order = order.map_or_else(|| Ok(greedy_order(&self.0)), |order| self.checked(order))?;
        let interruption = Mutex::new(None);
        let poll = || {
            let interrupted = Python::attach(|py| py.check_signals().err());
            let stops = interrupted.is_some();
            *interruption.lock().unwrap_or_else(PoisonError::into_inner) = interrupted;
            stops
        };
        let found = py.detach(|| plan(&self.0, order, seed, Limits { evaluations, seconds }, &poll));
        let interruption = interruption.into_inner().unwrap_or_else(PoisonError::into_inner);
        let found = found.map_err(|error| interruption.unwrap_or_else(|| raised(&error)))?;
        Ok((found.schedule, found.evaluations))
    }

    fn schedule(&self, py: Python, order: Vec<usize>) -> PyResult<Schedule> {
        let order = self.checked(order)?;
        Ok(py.detach(|| schedule_of(&self.0, &order)))
    }

    fn greedy(&self, py: Python) -> Schedule {
        py.detach(|| schedule_of(&self.0, &greedy_order(&self.0)))
    }

    fn random(&self, py: Python, seed: u64) -> Schedule {
        py.detach(|| random_schedule(&self.0, seed))
    }

    fn simulate(&self, py: Python, schedule: Schedule) -> PyResult<(Vec<f64>, Vec<f64>, f64)> {
        let outcome = py.detach(move || simulate(&self.0, &schedule)).map_err(|error| raised(&error))?;
        Ok((outcome.starts, outcome.returns, outcome.makespan))
    }
}
