//! `_core.Batch`: the batch of worlds as a Python class. Every array is checked here once.

use std::sync::Arc;

use innerattn_env::batch::{Autoreset, Batch as Worlds, Options};
use innerattn_env::fault::NUM_KINDS;
use innerattn_env::robot::Commands;
use innerattn_env::scenario::Actions;
use innerattn_env::task::Rescue;
use innerattn_env::world::World;
use numpy::{
    IntoPyArray, Ix1, Ix2, Ix3, PyArray, PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::Arrays;
use crate::rules::Rules;
use crate::value_error;

type Stepped = (
    Py<PyArray<f32, Ix3>>,
    Py<PyArray<f32, Ix2>>,
    Py<PyArray<bool, Ix1>>,
    Py<PyArray<bool, Ix1>>,
    Py<PyArray<f32, Ix3>>,
    Py<PyAny>,
);

/// Columns of a rescue, before those of its helpers.
const RESCUE_FIELDS: [&str; 6] = ["env", "episode", "step", "slot", "victim", "task"];

/// Many rescue worlds of one scenario.
#[pyclass(module = "innerattn._core")]
pub struct Batch {
    worlds: Worlds,
    /// What steps write, in turn.
    sets: [Arrays; 2],
    latest: usize,
    /// The type of a rescue, and the array of none.
    rescue_dtype: Py<PyAny>,
    no_rescues: Py<PyAny>,
    process: u32,
}

#[pymethods]
impl Batch {
    #[new]
    #[pyo3(signature = (rules, num_envs, seed, num_threads, first_env, autoreset))]
    fn new(
        py: Python,
        rules: &Rules,
        num_envs: usize,
        seed: u64,
        num_threads: Option<usize>,
        first_env: u64,
        autoreset: bool,
    ) -> PyResult<Self> {
        let autoreset = if autoreset { Autoreset::SameStep } else { Autoreset::Disabled };
        let options = Options { num_envs, seed, num_threads, first_env, autoreset };
        let rules = Arc::clone(&rules.0);
        let worlds = py.detach(|| Worlds::new(rules, options)).map_err(|error| value_error(&error))?;
        let (robots, width) = (worlds.rules().team.len(), worlds.rules().layout.width());
        let set = || Arrays::new(py, num_envs, robots, width);
        let rescue_dtype = rescue_dtype(py, worlds.rules().scenario.max_needs())?;
        Ok(Self {
            no_rescues: py.import("numpy")?.call_method1("empty", (0, &rescue_dtype))?.unbind(),
            rescue_dtype: rescue_dtype.unbind(),
            sets: [set()?, set()?],
            worlds,
            latest: 0,
            process: std::process::id(),
        })
    }

    #[getter]
    fn num_threads(&self) -> usize {
        self.worlds.num_threads()
    }

    #[getter]
    fn obs_width(&self) -> usize {
        self.worlds.rules().layout.width()
    }

    fn observation_names(&self) -> Vec<String> {
        self.worlds.rules().layout.names()
    }

    #[pyo3(signature = (seed, mask))]
    fn reset<'py>(
        &mut self,
        py: Python<'py>,
        seed: Option<u64>,
        mask: Option<Bound<PyArray1<bool>>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.check_process()?;
        let mask = self.mask(mask)?;
        let shape = self.obs_shape();
        let mut obs = vec![0.0; shape.iter().product()];
        let worlds = &mut self.worlds;
        py.detach(|| worlds.reset(seed, mask.as_deref(), &mut obs));
        shaped(py, obs, shape)
    }

    fn step(&mut self, py: Python, actions: &Bound<PyUntypedArray>) -> PyResult<Stepped> {
        self.check_process()?;
        let rescues = match self.worlds.rules().scenario.actions {
            Actions::Discrete => {
                let array = self.discrete(actions)?;
                let values = contiguous(&array.as_array());
                self.advance(py, Commands::Discrete(&values))?
            }
            Actions::Continuous => {
                let array = self.continuous(actions)?;
                let values = contiguous(&array.as_array());
                self.advance(py, Commands::Continuous(&values))?
            }
        };
        let set = &self.sets[self.latest];
        Ok((
            set.obs.lend(py),
            set.reward.lend(py),
            set.terminated.lend(py),
            set.truncated.lend(py),
            set.final_obs.lend(py),
            self.events(py, &rescues)?,
        ))
    }

    fn reward_components(&self, py: Python) -> Py<PyArray3<f32>> {
        self.sets[self.latest].components.lend(py)
    }

    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.check_process()?;
        let shape = self.obs_shape();
        let mut obs = vec![0.0; shape.iter().product()];
        self.worlds.observe(&mut obs);
        shaped(py, obs, shape)
    }

    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let robots = self.worlds.rules().team.len();
        self.vectors(py, robots, |world| &world.positions)
    }

    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let robots = self.worlds.rules().team.len();
        self.vectors(py, robots, |world| &world.velocities)
    }

    fn obstacles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let solids = self.worlds.rules().solids.len();
        self.vectors(py, solids, |world| &world.obstacles)
    }

    #[allow(clippy::type_complexity)]
    fn victims<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArray3<i64>>, Bound<'py, PyArray3<f32>>)> {
        let slots = self.worlds.rules().scenario.num_victims();
        let envs = self.worlds.num_envs();
        let mut numbers = Vec::with_capacity(envs * slots * 4);
        let mut places = Vec::with_capacity(envs * slots * 2);
        for victim in self.worlds.worlds().flat_map(|world| &world.victims) {
            if let Some(victim) = victim {
                numbers.extend([1, victim.task, victim.id, victim.appeared_step].map(i64::from));
                places.extend([victim.position.x, victim.position.y]);
            } else {
                numbers.extend([0, -1, -1, -1]);
                places.extend([0.0, 0.0]);
            }
        }
        Ok((shaped(py, numbers, [envs, slots, 4])?, shaped(py, places, [envs, slots, 2])?))
    }

    fn step_counts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.worlds.worlds().map(|world| i64::from(world.step)).collect::<Vec<_>>().into_pyarray(py)
    }

    fn episodes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        self.worlds.worlds().map(|world| world.episode as i64).collect::<Vec<_>>().into_pyarray(py)
    }

    fn set_motion(
        &mut self,
        positions: &Bound<PyArray3<f32>>,
        velocities: &Bound<PyArray3<f32>>,
    ) -> PyResult<()> {
        self.check_process()?;
        let wanted = [self.worlds.num_envs(), self.worlds.rules().team.len(), 2];
        for (name, shape) in [("positions", positions.shape()), ("velocities", velocities.shape())] {
            if shape != wanted {
                return Err(PyValueError::new_err(format!("{name} has shape {shape:?}: must be {wanted:?}")));
            }
        }
        let (positions, velocities) = (positions.readonly(), velocities.readonly());
        let (positions, velocities) = (contiguous(&positions.as_array()), contiguous(&velocities.as_array()));
        self.worlds.set_motion(&positions, &velocities).map_err(|error| value_error(&error))
    }

    fn fault_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let robots = self.worlds.rules().team.len();
        let of =
            |world: &'_ World| (0..robots).flat_map(|robot| world.faults.levels(robot)).collect::<Vec<_>>();
        let numbers = self.worlds.worlds().flat_map(of);
        shaped(py, numbers.collect(), [self.worlds.num_envs(), robots, NUM_KINDS])
    }

    #[pyo3(signature = (levels, mask))]
    fn set_faults(
        &mut self,
        levels: &Bound<PyArray3<f32>>,
        mask: Option<Bound<PyArray1<bool>>>,
    ) -> PyResult<()> {
        self.check_process()?;
        let wanted = [self.worlds.num_envs(), self.worlds.rules().team.len(), NUM_KINDS];
        if levels.shape() != wanted {
            let (found, [envs, robots, _]) = (&levels.shape()[..2], wanted);
            return Err(PyValueError::new_err(format!(
                "faults has shape {found:?}: must be [{envs}, {robots}]"
            )));
        }
        let mask = self.mask(mask)?;
        let levels = levels.readonly();
        let levels = contiguous(&levels.as_array());
        self.worlds.set_faults(&levels, mask.as_deref()).map_err(|error| value_error(&error))
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &py.detach(|| self.worlds.snapshot()))
    }

    fn restore(&mut self, py: Python, image: &[u8]) -> PyResult<()> {
        self.check_process()?;
        let worlds = &mut self.worlds;
        py.detach(|| worlds.restore(image)).map_err(|error| value_error(&error))
    }
}

impl Batch {
    /// A pool's threads do not survive a fork: a child would step with one thread and not know why.
    fn check_process(&self) -> PyResult<()> {
        if self.worlds.num_threads() == 1 || self.process == std::process::id() {
            return Ok(());
        }
        Err(PyRuntimeError::new_err(
            "this environment was made before a fork; make a new one in the child process, and \
             restore(snapshot()) to go on from the same state",
        ))
    }

    /// Envs, robots and columns.
    fn obs_shape(&self) -> [usize; 3] {
        let rules = self.worlds.rules();
        [self.worlds.num_envs(), rules.team.len(), rules.layout.width()]
    }

    /// A mask with one flag for each env.
    fn mask(&self, mask: Option<Bound<PyArray1<bool>>>) -> PyResult<Option<Vec<bool>>> {
        let mask = mask.map(|mask| mask.readonly().as_array().to_vec());
        let wanted = self.worlds.num_envs();
        match mask.as_ref().map(Vec::len) {
            Some(found) if found != wanted => {
                Err(PyValueError::new_err(format!("mask has shape ({found},): must be ({wanted},)")))
            }
            _ => Ok(mask),
        }
    }

    fn advance(&mut self, py: Python, commands: Commands) -> PyResult<Vec<Rescue>> {
        let next = 1 - self.latest;
        let buffers = self.sets[next].buffers();
        let worlds = &mut self.worlds;
        let rescues = py.detach(|| worlds.step(commands, buffers)).map_err(|error| value_error(&error))?;
        self.latest = next;
        Ok(rescues)
    }

    /// The actions as `(E, R)` int64.
    fn discrete<'py>(&self, actions: &Bound<'py, PyUntypedArray>) -> PyResult<PyReadonlyArray2<'py, i64>> {
        let (envs, robots) = (self.worlds.num_envs(), self.worlds.rules().team.len());
        if let Ok(actions) = actions.extract::<PyReadonlyArray2<i64>>()
            && actions.shape() == [envs, robots]
            && actions.is_aligned()
        {
            return Ok(actions);
        }
        let kind: String = actions.dtype().getattr("kind")?.extract()?;
        if kind != "i" && kind != "u" {
            let dtype = actions.dtype();
            return Err(PyTypeError::new_err(format!("actions has dtype {dtype}: must be integers")));
        }
        if actions.shape() != [envs, robots] {
            return Err(wrong_shape(actions, &format!("({envs}, {robots})")));
        }
        // Numbers past int64 wrap to negative ones, which the range check refuses.
        actions.call_method1("astype", ("int64",))?.extract()
    }

    /// The actions as `(E, R, 2)` float32.
    fn continuous<'py>(&self, actions: &Bound<'py, PyUntypedArray>) -> PyResult<PyReadonlyArray3<'py, f32>> {
        let (envs, robots) = (self.worlds.num_envs(), self.worlds.rules().team.len());
        let kind: String = actions.dtype().getattr("kind")?.extract()?;
        if kind != "f" {
            let dtype = actions.dtype();
            return Err(PyTypeError::new_err(format!("actions has dtype {dtype}: must be floats")));
        }
        if actions.shape() != [envs, robots, 2] {
            return Err(wrong_shape(actions, &format!("({envs}, {robots}, 2)")));
        }
        actions.call_method1("astype", ("float32",))?.extract()
    }

    fn vectors<'py>(
        &self,
        py: Python<'py>,
        rows: usize,
        of: impl Fn(&World) -> &Vec<innerattn_env::geometry::Vec2>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let numbers = self.worlds.worlds().flat_map(|world| of(world).iter().flat_map(|at| [at.x, at.y]));
        shaped(py, numbers.collect(), [self.worlds.num_envs(), rows, 2])
    }

    /// Rescues as a structured array: env, episode, step, slot, victim, task and one helper for each
    /// possible need.
    fn events(&self, py: Python, rescues: &[Rescue]) -> PyResult<Py<PyAny>> {
        if rescues.is_empty() {
            return Ok(self.no_rescues.clone_ref(py));
        }
        let helpers = self.worlds.rules().scenario.max_needs();
        let mut rows = Vec::with_capacity(rescues.len() * (RESCUE_FIELDS.len() + helpers));
        for rescue in rescues {
            rows.extend([i64::from(rescue.env), rescue.episode as i64]);
            rows.extend([rescue.step, rescue.slot, rescue.victim, rescue.task].map(i64::from));
            rows.extend(rescue.helpers[..helpers].iter().map(|helper| helper.map_or(-1, i64::from)));
        }
        Ok(rows.into_pyarray(py).call_method1("view", (&self.rescue_dtype,))?.unbind())
    }
}

/// A structured type of int64 fields.
fn rescue_dtype(py: Python, helpers: usize) -> PyResult<Bound<PyAny>> {
    let helpers = (0..helpers).map(|need| format!("helper_{need}"));
    let names = RESCUE_FIELDS.map(String::from).into_iter().chain(helpers);
    let fields: Vec<(String, &str)> = names.map(|name| (name, "i8")).collect();
    py.import("numpy")?.call_method1("dtype", (fields,))
}

fn wrong_shape(actions: &Bound<PyUntypedArray>, wanted: &str) -> PyErr {
    PyValueError::new_err(format!("actions has shape {:?}: must be {wanted}", actions.shape()))
}

fn contiguous<'a, T: Clone, D: numpy::ndarray::Dimension>(
    array: &numpy::ndarray::ArrayView<'a, T, D>,
) -> std::borrow::Cow<'a, [T]> {
    match array.to_slice() {
        Some(values) => std::borrow::Cow::Borrowed(values),
        None => std::borrow::Cow::Owned(array.iter().cloned().collect()),
    }
}

fn shaped<T: numpy::Element, const N: usize>(
    py: Python<'_>,
    values: Vec<T>,
    shape: [usize; N],
) -> PyResult<Bound<'_, PyArray<T, numpy::ndarray::Dim<[usize; N]>>>>
where
    [usize; N]: numpy::ndarray::IntoDimension<Dim = numpy::ndarray::Dim<[usize; N]>>,
    numpy::ndarray::Dim<[usize; N]>: numpy::ndarray::Dimension,
{
    values.into_pyarray(py).reshape(shape)
}
