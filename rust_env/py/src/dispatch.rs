//! `_core.Dispatcher`: plans for worlds, as a Python object over numpy arrays.

use innerattn_planner::coalition::Candidates;
use innerattn_planner::dispatch::{Aim, Goal, dispatch};
use innerattn_planner::instance::{MAX_ROBOTS, MAX_SKILLS};
use innerattn_planner::moment::{MAX_VICTIMS, Moment, Needs, Sums, Team, Victim};
use innerattn_planner::ways::{Battery, Depot, Mover, Stand, Station, Ways};
use numpy::{PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::door::Door;

/// A robot: speed and lag; capacity, energy for each metre and start, and idle power of its battery; its
/// load; and the amount of each ability that it has.
type GivenRobot = (f64, f64, Option<[f64; 4]>, Option<u32>, Vec<f64>);
/// What a victim needs: abilities, one for each robot, or amounts by ability.
type GivenNeeds = (Vec<u8>, Option<Vec<f64>>);

/// The team and the tasks of a scenario, ready to be planned for.
#[pyclass(frozen, module = "innerattn._core")]
pub struct Dispatcher {
    team: Team,
    aim: Aim,
    orders: usize,
}

#[pymethods]
impl Dispatcher {
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn new(
        robots: Vec<GivenRobot>,
        needs: Vec<GivenNeeds>,
        stations: Vec<([f64; 2], f64, f64)>,
        depots: Vec<([f64; 2], f64)>,
        radius: f64,
        along_axes: bool,
        aim: (f64, f64),
        orders: usize,
    ) -> PyResult<Self> {
        let counted = |name: &str, count: usize, most: usize| {
            let refused =
                || PyValueError::new_err(format!("{name} (their number) = {count}: must be 1 to {most}"));
            if (1..=most).contains(&count) { Ok(()) } else { Err(refused()) }
        };
        counted("robots", robots.len(), MAX_ROBOTS)?;
        counted("orders", orders, usize::MAX)?;
        for (abilities, _) in &needs {
            if abilities.iter().any(|ability| usize::from(*ability) >= MAX_SKILLS) {
                return Err(PyValueError::new_err(format!(
                    "needs = {abilities:?}: must be 0 to {}",
                    MAX_SKILLS - 1
                )));
            }
        }
        let amounts: Vec<Vec<f64>> = robots.iter().map(|robot| robot.4.clone()).collect();
        let has = |(ability, amount): (usize, &f64)| u32::from(*amount > 0.0) << ability;
        let skills: Vec<u32> = amounts
            .iter()
            .map(|amounts| amounts.iter().enumerate().take(MAX_SKILLS).map(has).sum())
            .collect();
        let needs = needs.into_iter().map(|(list, sums)| match sums {
            Some(needed) => Needs::Sums(Sums::new(&needed, &amounts)),
            None => Needs::List(Candidates::new(&list, &skills)),
        });
        let battery = |[capacity, per_m, start, idle]: [f64; 4]| Battery { capacity, per_m, start, idle };
        let mover = |(speed, lag, found, load, _): GivenRobot| Mover {
            speed,
            lag,
            battery: found.map(battery),
            load,
        };
        let ways = Ways {
            movers: robots.into_iter().map(mover).collect(),
            stations: stations
                .into_iter()
                .map(|(place, radius, power)| Station { place, radius, power })
                .collect(),
            depots: depots.into_iter().map(|(place, radius)| Depot { place, radius }).collect(),
            radius,
            along_axes,
        };
        Ok(Self { team: Team { ways, needs: needs.collect() }, aim: Aim { sum: aim.0, last: aim.1 }, orders })
    }

    #[allow(clippy::too_many_arguments)]
    fn choose<'py>(
        &self,
        py: Python<'py>,
        positions: &Bound<PyAny>,
        charges: &Bound<PyAny>,
        loads: &Bound<PyAny>,
        times: &Bound<PyAny>,
        numbers: &Bound<PyAny>,
        victims: &Bound<PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let robots = self.team.ways.movers.len();
        let lengths = |of: &Bound<PyAny>| of.getattr("shape")?.extract::<(usize, usize, usize)>();
        let (envs, _, slots) = lengths(times)?;
        if slots > MAX_VICTIMS {
            return Err(PyValueError::new_err(format!(
                "times.shape[2] = {slots}: must be at most {MAX_VICTIMS}"
            )));
        }
        let [mut at, mut charge, mut arrival, mut found] = [const { vec![] }; 4];
        let [mut number, mut load] = [const { vec![] }; 2];
        Door::floats("positions", &[envs, robots, 2]).read_f64(positions, &mut at)?;
        Door::floats("charges", &[envs, robots]).read_f64(charges, &mut charge)?;
        Door::integers("loads", &[envs, robots]).read_i64(loads, &mut load)?;
        Door::floats("times", &[envs, robots, slots]).read_f64(times, &mut arrival)?;
        Door::integers("numbers", &[envs, slots, 2]).read_i64(numbers, &mut number)?;
        Door::floats("victims", &[envs, slots, 4]).read_f64(victims, &mut found)?;
        let kinds = self.team.needs.len() as i64;
        if let Some(kind) = number.iter().step_by(2).find(|kind| !(-1..kinds).contains(*kind)) {
            return Err(PyValueError::new_err(format!(
                "numbers[..., 0] = {kind}: must be -1 to {}",
                kinds - 1
            )));
        }
        let mut goals = vec![-1; envs * robots];
        let all_are_ordered = py.detach(|| {
            goals.chunks_exact_mut(robots).enumerate().all(|(env, goals)| {
                let rows = Rows {
                    at: &at[env * robots * 2..],
                    charge: &charge[env * robots..],
                    load: &load[env * robots..],
                    arrival: &arrival[env * robots * slots..],
                    number: &number[env * slots * 2..],
                    found: &found[env * slots * 4..],
                };
                let (moment, slot) = rows.moment(robots, slots);
                if !moment.is_ordered() {
                    return false;
                }
                let found = dispatch(&self.team, &moment, self.aim, self.orders);
                for (goal, found) in goals.iter_mut().zip(found.goals) {
                    *goal = if let Goal::Victim(victim) = found { slot[victim] as i64 } else { -1 };
                }
                true
            })
        });
        if !all_are_ordered {
            return Err(PyValueError::new_err(
                "numbers[..., 1]: victims must not wait for each other in a circle",
            ));
        }
        let goals = numpy::PyArray1::from_vec(py, goals);
        goals.reshape([envs, robots])
    }
}

/// The numbers of one world and of those after it.
struct Rows<'a> {
    at: &'a [f64],
    charge: &'a [f64],
    load: &'a [i64],
    arrival: &'a [f64],
    number: &'a [i64],
    found: &'a [f64],
}

impl Rows<'_> {
    /// The world's moment, and the slots of its victims.
    fn moment(&self, robots: usize, slots: usize) -> (Moment, Vec<usize>) {
        let stand = |robot: usize| Stand {
            place: [self.at[2 * robot], self.at[2 * robot + 1]],
            free: 0.0,
            charge: self.charge[robot],
            load: self.load[robot].clamp(0, i64::from(u32::MAX)) as u32,
        };
        let present: Vec<usize> = (0..slots).filter(|slot| self.number[2 * slot] >= 0).collect();
        let after = |slot: usize| {
            let bit =
                |(index, other): (usize, &usize)| ((self.number[2 * slot + 1] >> other & 1) as u32) << index;
            present.iter().enumerate().map(bit).sum()
        };
        let victim = |slot: usize| {
            let found = &self.found[4 * slot..4 * slot + 4];
            let (place, kind) = ([found[0], found[1]], self.number[2 * slot] as usize);
            Victim { kind, place, work: found[2], left: found[3], after: after(slot) }
        };
        let arrivals = |slot: usize| (0..robots).map(|robot| self.arrival[robot * slots + slot]).collect();
        let moment = Moment {
            stands: (0..robots).map(stand).collect(),
            victims: present.iter().map(|slot| victim(*slot)).collect(),
            arrivals: present.iter().map(|slot| arrivals(*slot)).collect(),
        };
        (moment, present)
    }
}
