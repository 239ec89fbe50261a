//! `_core.Batch`: the batch of worlds as a Python class. Every array is checked here once.

use std::sync::{Arc, Mutex, PoisonError};

use innerattn_env::batch::{Autoreset, Batch as Worlds, Options};
use innerattn_env::error::Error;
use innerattn_env::fault::NUM_KINDS;
use innerattn_env::fault_state::FaultState;
use innerattn_env::robot::Commands;
use innerattn_env::scenario::Actions;
use innerattn_env::sight::NEVER;
use innerattn_env::snapshot::most_bytes;
use innerattn_env::tasks::Rescue;
use innerattn_env::world::World;
use numpy::{IntoPyArray, Ix1, Ix2, Ix3, PyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::Outputs;
use crate::door::{Door, gather, probe, reserve, zeros};
use crate::raised;
use crate::rules::Rules;

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

/// Memory for what a batch has beside its arrays and worlds, and for each thread, bytes.
const SLACK_BYTES: usize = 64 << 20;
const THREAD_BYTES: usize = 4 << 20;

/// Many rescue worlds of one scenario.
#[pyclass(module = "innerattn._core")]
pub struct Batch {
    worlds: Worlds,
    /// The actions of a step, in one of the two.
    discrete: Vec<i64>,
    continuous: Vec<f32>,
    outputs: Outputs,
    /// The type of a rescue, and the array of none.
    rescue_dtype: Py<PyAny>,
    no_rescues: Py<PyAny>,
    process: u32,
}

#[pymethods]
impl Batch {
    #[new]
    #[pyo3(signature = (rules, num_envs, seed, num_threads, first_env, autoreset, give))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python,
        rules: &Rules,
        num_envs: usize,
        seed: u64,
        num_threads: Option<usize>,
        first_env: u64,
        autoreset: &str,
        give: bool,
    ) -> PyResult<Self> {
        let autoreset = autoreset_named(autoreset)?;
        let options = Options { num_envs, seed, num_threads, first_env, autoreset };
        let rules = Arc::clone(&rules.0);
        Worlds::check(&options).map_err(|error| raised(py, &error))?;
        let (robots, width) = (rules.team.len(), rules.layout.width());
        let outputs = Outputs::new(py, num_envs, robots, width, give)?;
        let rescue_dtype = event_dtype(py, rules.scenario.max_helpers())?;
        let threads = num_threads.unwrap_or(1) * THREAD_BYTES;
        probe(py, num_envs * World::most_bytes(&rules) + SLACK_BYTES + threads)?;
        let worlds = py.detach(|| Worlds::new(rules, options)).map_err(|error| raised(py, &error))?;
        Ok(Self {
            no_rescues: py.import("numpy")?.call_method1("empty", (0, &rescue_dtype))?.unbind(),
            rescue_dtype: rescue_dtype.unbind(),
            discrete: vec![],
            continuous: vec![],
            outputs,
            worlds,
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
        mask: Option<Bound<PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.check_process()?;
        let mask = self.mask(mask)?;
        let shape = self.obs_shape();
        let mut obs = zeros(shape.iter().product())?;
        let worlds = &mut self.worlds;
        py.detach(|| worlds.reset(seed, mask.as_deref(), &mut obs));
        shaped(py, obs, shape)
    }

    fn step(&mut self, py: Python, actions: &Bound<PyAny>) -> PyResult<Stepped> {
        self.check_process()?;
        let [envs, robots, _] = self.obs_shape();
        let rescues = match self.worlds.rules().scenario.actions {
            Actions::Discrete => {
                Door::integers("actions", &[envs, robots]).read_i64(actions, &mut self.discrete)?;
                let commands = Commands::Discrete(&self.discrete);
                advance(py, &mut self.worlds, &mut self.outputs, commands)?
            }
            Actions::Continuous => {
                Door::floats("actions", &[envs, robots, 2]).read_f32(actions, &mut self.continuous)?;
                let commands = Commands::Continuous(&self.continuous);
                advance(py, &mut self.worlds, &mut self.outputs, commands)?
            }
        };
        let events = self.events(py, &rescues)?;
        let (obs, reward, terminated, truncated, final_obs) = self.outputs.hand_out(py);
        Ok((obs, reward, terminated, truncated, final_obs, events))
    }

    /// For tests: lets these worlds panic in the next step.
    fn _panic_in_next_step(&mut self, envs: Vec<usize>) {
        self.worlds.panic_in_next_step(envs);
    }

    /// The victims lost in the last step, as a structured array: env, episode, step, slot, victim, task.
    fn lost(&self, py: Python) -> PyResult<Py<PyAny>> {
        self.check_process()?;
        let mut rows = Vec::new();
        reserve(&mut rows, self.worlds.losses().count() * RESCUE_FIELDS.len())?;
        for loss in self.worlds.losses() {
            rows.extend([i64::from(loss.env), loss.episode as i64]);
            rows.extend([loss.step, loss.slot, loss.victim, loss.task].map(i64::from));
        }
        Ok(rows.into_pyarray(py).call_method1("view", (event_dtype(py, 0)?,))?.unbind())
    }

    fn turned_away<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let mut counts = zeros(self.worlds.num_envs())?;
        self.worlds.turned_away().for_each(|env| counts[env as usize] += 1);
        Ok(counts.into_pyarray(py))
    }

    fn reward_components(&self, py: Python) -> Py<PyArray3<f32>> {
        self.outputs.components(py)
    }

    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        self.check_process()?;
        let shape = self.obs_shape();
        let mut obs = zeros(shape.iter().product())?;
        self.worlds.observe(&mut obs);
        shaped(py, obs, shape)
    }

    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let robots = self.worlds.rules().team.len();
        self.vectors(py, robots, |world| &world.positions)
    }

    fn headings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.by_robot(py, |world, robot| world.headings.get(robot).map_or(0.0, |heading| heading.angle))
    }

    fn turn_rates<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        self.by_robot(py, |world, robot| world.headings.get(robot).map_or(0.0, |heading| heading.turn_rate))
    }

    fn charge<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let energy = self.worlds.rules().energy.as_ref();
        self.by_robot(py, |world, robot| energy.map_or(1.0, |one| one.share(robot, &world.charges)))
    }

    fn load<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let supplies = self.worlds.rules().supplies.as_ref();
        self.by_robot(py, |world, robot| supplies.map_or(1.0, |one| one.share(robot, &world.loads)))
    }

    fn can_act<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let rules = self.worlds.rules();
        self.by_robot(py, |world, robot| world.away(rules) >> robot & 1 == 0)
    }

    fn last_seen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<i64>>> {
        let rules = self.worlds.rules();
        let robots = rules.team.len();
        let shape = [self.worlds.num_envs(), robots, robots + rules.scenario.num_victims()];
        let of = |world: &World| match &rules.sight {
            Some(_) => {
                let last = world.last_seen(rules);
                last.iter().map(|last| if *last == NEVER { -1 } else { (*last).into() }).collect()
            }
            None => vec![i64::from(world.step); shape[1] * shape[2]],
        };
        shaped(py, gather(shape.iter().product(), self.worlds.worlds().flat_map(of))?, shape)
    }

    fn heard<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<bool>>> {
        let rules = self.worlds.rules();
        let robots = rules.team.len();
        let of = |world: &World| {
            let heard = world.heard(rules);
            heard
                .into_iter()
                .flat_map(|one| (0..robots).map(move |other| one >> other & 1 == 1))
                .collect::<Vec<_>>()
        };
        let shape = [self.worlds.num_envs(), robots, robots];
        shaped(py, gather(shape.iter().product(), self.worlds.worlds().flat_map(of))?, shape)
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
        let rules = self.worlds.rules();
        let (envs, slots) = (self.worlds.num_envs(), rules.scenario.num_victims());
        let (mut numbers, mut places) = (zeros(envs * slots * 6)?, zeros(envs * slots * 3)?);
        let rows = numbers.chunks_exact_mut(6).zip(places.chunks_exact_mut(3));
        let worlds = self.worlds.worlds();
        let victims = worlds.flat_map(|world| world.victims.iter().map(move |one| (one, &world.victims)));
        for ((number, place), (victim, all)) in rows.zip(victims) {
            if let Some(victim) = victim {
                let deadline =
                    if victim.deadline_step == u32::MAX { -1 } else { victim.deadline_step.into() };
                let [task, id, appeared] = [victim.task, victim.id, victim.appeared_step].map(i64::from);
                let blocked = rules.order.as_ref().is_some_and(|order| order.is_blocked(victim, all));
                number.copy_from_slice(&[1, task, id, appeared, deadline, blocked.into()]);
                let served = rules.services[victim.task as usize].share(victim);
                place.copy_from_slice(&[victim.position.x, victim.position.y, served]);
            } else {
                number.copy_from_slice(&[0, -1, -1, -1, -1, 0]);
            }
        }
        Ok((shaped(py, numbers, [envs, slots, 6])?, shaped(py, places, [envs, slots, 3])?))
    }

    fn step_counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let counts = self.worlds.worlds().map(|world| i64::from(world.step));
        Ok(gather(self.worlds.num_envs(), counts)?.into_pyarray(py))
    }

    fn episodes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let episodes = self.worlds.worlds().map(|world| world.episode as i64);
        Ok(gather(self.worlds.num_envs(), episodes)?.into_pyarray(py))
    }

    fn set_motion(
        &mut self,
        py: Python,
        positions: &Bound<PyAny>,
        velocities: &Bound<PyAny>,
    ) -> PyResult<()> {
        self.check_process()?;
        let [envs, robots, _] = self.obs_shape();
        let shape = [envs, robots, 2];
        let (mut places, mut speeds) = (vec![], vec![]);
        Door::numbers("positions", &shape).read_f32(positions, &mut places)?;
        Door::numbers("velocities", &shape).read_f32(velocities, &mut speeds)?;
        self.worlds.set_motion(&places, &speeds).map_err(|error| raised(py, &error))
    }

    fn set_headings(&mut self, py: Python, headings: &Bound<PyAny>) -> PyResult<()> {
        self.check_process()?;
        let [envs, robots, _] = self.obs_shape();
        let mut angles = vec![];
        Door::numbers("headings", &[envs, robots]).read_f32(headings, &mut angles)?;
        self.worlds.set_headings(&angles).map_err(|error| raised(py, &error))
    }

    fn set_victims(
        &mut self,
        py: Python,
        present: &Bound<PyAny>,
        tasks: &Bound<PyAny>,
        places: &Bound<PyAny>,
    ) -> PyResult<()> {
        self.check_process()?;
        let (envs, slots) = (self.worlds.num_envs(), self.worlds.rules().scenario.num_victims());
        let (mut numbers, mut metres) = (vec![], vec![]);
        let present = Door::flags("victims[present]", &[envs, slots]).read_flags(present)?;
        Door::integers("victims[task]", &[envs, slots]).read_i64(tasks, &mut numbers)?;
        Door::numbers("victims[place]", &[envs, slots, 2]).read_f32(places, &mut metres)?;
        self.worlds.set_victims(&present, &numbers, &metres).map_err(|error| raised(py, &error))
    }

    fn fault_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let [envs, robots, _] = self.obs_shape();
        let of =
            |world: &'_ World| (0..robots).flat_map(|robot| world.faults.levels(robot)).collect::<Vec<_>>();
        let numbers = self.worlds.worlds().flat_map(of);
        shaped(py, gather(envs * robots * NUM_KINDS, numbers)?, [envs, robots, NUM_KINDS])
    }

    #[pyo3(signature = (levels, mask))]
    fn set_faults(&mut self, py: Python, levels: &Bound<PyAny>, mask: Option<Bound<PyAny>>) -> PyResult<()> {
        self.check_process()?;
        let [envs, robots, width] = self.obs_shape();
        let mut numbers = vec![];
        Door::numbers("faults", &[envs, robots, NUM_KINDS]).read_f32(levels, &mut numbers)?;
        let mask = self.mask(mask)?;
        probe(py, envs * FaultState::most_bytes(robots, width))?;
        self.worlds.set_faults(&numbers, mask.as_deref()).map_err(|error| raised(py, &error))
    }

    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let envs = self.worlds.num_envs();
        // The image, as it grows, and the bytes.
        probe(py, 3 * most_bytes(self.worlds.rules(), envs))?;
        Ok(PyBytes::new(py, &py.detach(|| self.worlds.snapshot())))
    }

    fn restore(&mut self, py: Python, image: &[u8]) -> PyResult<()> {
        self.check_process()?;
        let (rules, envs) = (self.worlds.rules(), self.worlds.num_envs());
        probe(py, envs * World::most_bytes(rules) + image.len())?;
        let worlds = &mut self.worlds;
        py.detach(|| worlds.restore(image)).map_err(|error| raised(py, &error))
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
    fn mask(&self, mask: Option<Bound<PyAny>>) -> PyResult<Option<Vec<bool>>> {
        let shape = [self.worlds.num_envs()];
        mask.map(|mask| Door::flags("mask", &shape).read_flags(&mask)).transpose()
    }

    /// A number of each robot, (E, R).
    fn by_robot<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        of: impl Fn(&World, usize) -> T,
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        let shape = [self.worlds.num_envs(), self.worlds.rules().team.len()];
        let of = |world| (0..shape[1]).map(|robot| of(world, robot)).collect::<Vec<_>>();
        gather(shape.iter().product(), self.worlds.worlds().flat_map(of))?.into_pyarray(py).reshape(shape)
    }

    fn vectors<'py>(
        &self,
        py: Python<'py>,
        rows: usize,
        of: impl Fn(&World) -> &Vec<innerattn_env::geometry::Vec2>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let numbers = self.worlds.worlds().flat_map(|world| of(world).iter().flat_map(|at| [at.x, at.y]));
        let shape = [self.worlds.num_envs(), rows, 2];
        shaped(py, gather(shape.iter().product(), numbers)?, shape)
    }

    /// Rescues as a structured array: env, episode, step, slot, victim, task and the most helpers
    /// that there can be.
    fn events(&self, py: Python, rescues: &[Rescue]) -> PyResult<Py<PyAny>> {
        if rescues.is_empty() {
            return Ok(self.no_rescues.clone_ref(py));
        }
        let helpers = self.worlds.rules().scenario.max_helpers();
        let mut rows = Vec::new();
        reserve(&mut rows, rescues.len() * (RESCUE_FIELDS.len() + helpers))?;
        for rescue in rescues {
            rows.extend([i64::from(rescue.env), rescue.episode as i64]);
            rows.extend([rescue.step, rescue.slot, rescue.victim, rescue.task].map(i64::from));
            rows.extend(rescue.helpers[..helpers].iter().map(|helper| helper.map_or(-1, i64::from)));
        }
        Ok(rows.into_pyarray(py).call_method1("view", (&self.rescue_dtype,))?.unbind())
    }
}

/// What happens when an episode ends, by its name in Python.
fn autoreset_named(name: &str) -> PyResult<Autoreset> {
    match name {
        "same_step" => Ok(Autoreset::SameStep),
        "next_step" => Ok(Autoreset::NextStep),
        "disabled" => Ok(Autoreset::Disabled),
        _ => Err(PyValueError::new_err(format!(
            "autoreset = {name:?}: must be \"same_step\", \"next_step\" or \"disabled\""
        ))),
    }
}

/// A structured type of int64 fields: of a rescue, or of a loss, which nobody helped with.
fn event_dtype(py: Python, helpers: usize) -> PyResult<Bound<PyAny>> {
    let helpers = (0..helpers).map(|need| format!("helper_{need}"));
    let names = RESCUE_FIELDS.map(String::from).into_iter().chain(helpers);
    let fields: Vec<(String, &str)> = names.map(|name| (name, "i8")).collect();
    py.import("numpy")?.call_method1("dtype", (fields,))
}

/// Steps the worlds, which write into the arrays whose turn it is. A panic of some worlds counts as a step of
/// all.
fn advance(
    py: Python,
    worlds: &mut Worlds,
    outputs: &mut Outputs,
    commands: Commands,
) -> PyResult<Vec<Rescue>> {
    let buffers = outputs.next(py)?;
    let interruption = Mutex::new(None);
    let poll = || {
        let interrupted = Python::attach(|py| py.check_signals().err());
        let stops = interrupted.is_some();
        *interruption.lock().unwrap_or_else(PoisonError::into_inner) = interrupted;
        stops
    };
    let stepped = py.detach(|| worlds.step_polled(commands, buffers, Some(&poll)));
    if matches!(stepped, Ok(_) | Err(Error::Panicked { .. })) {
        outputs.stepped();
    }
    let interruption = interruption.into_inner().unwrap_or_else(PoisonError::into_inner);
    stepped.map_err(|error| interruption.unwrap_or_else(|| raised(py, &error)))
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
