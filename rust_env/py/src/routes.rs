//! `_core.Routes`: ways around obstacles, as a Python object over numpy arrays.

use std::sync::Mutex;

use innerattn_env::geometry::Vec2;
use innerattn_env::routes::Routes as Shared;
use numpy::{PyArray1, PyArray3, PyArray4, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::door::Door;
use crate::rules::Rules;

/// Finds the ways of a scenario's team.
#[pyclass(frozen, module = "innerattn._core")]
pub struct Routes {
    robots: usize,
    obstacles: usize,
    /// Locked only while Python's lock is not held, so that neither waits for the other.
    shared: Mutex<Shared>,
}

/// Lengths (E, R, G) and next turns (E, R, G, 2).
type Found<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray4<f32>>);

#[pymethods]
impl Routes {
    #[new]
    fn new(rules: &Rules) -> Self {
        let (robots, obstacles) = (rules.0.team.len(), rules.0.solids.len());
        Self { robots, obstacles, shared: Mutex::new(Shared::new(&rules.0)) }
    }

    fn ways<'py>(
        &self,
        py: Python<'py>,
        obstacles: &Bound<PyAny>,
        positions: &Bound<PyAny>,
        goals: &Bound<PyAny>,
    ) -> PyResult<Found<'py>> {
        let robots = self.robots;
        let (envs, count) = shape_of(goals)?;
        let solids = vectors("obstacles", obstacles, &[envs, self.obstacles, 2])?;
        let at = vectors("positions", positions, &[envs, robots, 2])?;
        let goals = vectors("goals", goals, &[envs, robots, count, 2])?;
        let (mut lengths, mut next) = (vec![], vec![]);
        py.detach(|| {
            let mut shared = self.locked();
            shared.begin();
            for (index, goal) in goals.iter().enumerate() {
                let row = index / count;
                let solids = of_world(&solids, row / robots, self.obstacles);
                let way = shared.way(row % robots, solids, at[row], *goal);
                lengths.push(way.length);
                next.extend([way.next.x, way.next.y]);
            }
        });
        Ok((
            PyArray1::from_vec(py, lengths).reshape([envs, robots, count])?,
            PyArray1::from_vec(py, next).reshape([envs, robots, count, 2])?,
        ))
    }

    fn left<'py>(
        &self,
        py: Python<'py>,
        obstacles: &Bound<PyAny>,
        positions: &Bound<PyAny>,
        towards: &Bound<PyAny>,
        goals: &Bound<PyAny>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let robots = self.robots;
        let (envs, count) = shape_of(towards)?;
        let solids = vectors("obstacles", obstacles, &[envs, self.obstacles, 2])?;
        let at = vectors("positions", positions, &[envs, robots, 2])?;
        let towards = vectors("towards", towards, &[envs, robots, count, 2])?;
        let goals = vectors("goals", goals, &[envs, robots, 2])?;
        let mut lengths = vec![];
        py.detach(|| {
            let mut shared = self.locked();
            shared.begin();
            for (index, place) in towards.iter().enumerate() {
                let row = index / count;
                let solids = of_world(&solids, row / robots, self.obstacles);
                lengths.push(shared.left(row % robots, solids, at[row], *place, goals[row]));
            }
        });
        PyArray1::from_vec(py, lengths).reshape([envs, robots, count])
    }
}

impl Routes {
    /// What a panic has left is no worse: fields only grow.
    fn locked(&self) -> std::sync::MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

fn of_world(solids: &[Vec2], env: usize, count: usize) -> &[Vec2] {
    &solids[env * count..][..count]
}

/// Numbers of worlds and of places for each robot in an array (E, R, K, 2).
fn shape_of(array: &Bound<PyAny>) -> PyResult<(usize, usize)> {
    let (envs, _, count, _) = array.getattr("shape")?.extract::<(usize, usize, usize, usize)>()?;
    Ok((envs, count))
}

fn vectors(name: &'static str, given: &Bound<PyAny>, shape: &[usize]) -> PyResult<Vec<Vec2>> {
    let mut numbers = vec![];
    Door::floats(name, shape).read_f32(given, &mut numbers)?;
    if let Some(value) = numbers.iter().find(|number| !number.is_finite()) {
        return Err(PyValueError::new_err(format!("{name} = {value}: must be finite numbers")));
    }
    Ok(numbers.chunks_exact(2).map(|pair| Vec2::new(pair[0], pair[1])).collect())
}
