//! Instances: where robots and tasks are, who can do what, and how long it takes to get anywhere. Checked
//! once; everything else in the crate trusts it.

use std::ops::Range;

use crate::coalition::fills;
use crate::error::{Error, Result};

/// Most robots: sets of them are masks of 64 bits.
pub const MAX_ROBOTS: usize = 64;
/// Most tasks.
pub const MAX_TASKS: usize = 500;
/// Skills are numbered from 0 to one less than this.
pub const MAX_SKILLS: usize = 32;
/// Largest coordinate, duration and speed.
const MOST: f64 = 1e6;
/// Least speed.
const LEAST_SPEED: f64 = 1e-6;

/// A robot as an instance describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    /// Where it begins and where it returns to.
    pub depot: [f64; 2],
    /// Mask of the skills that it has. It uses one at a time.
    pub skills: u32,
}

/// A task as an instance describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Where it is.
    pub position: [f64; 2],
    /// A skill for each robot that must be there; one that comes twice needs two robots.
    pub needs: Vec<u8>,
    /// How long the robots work on it together.
    pub duration: f64,
}

/// Robots that can fill the needs of one skill of a task, and how many of them it needs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Group {
    /// Their places in the task's list of able robots.
    pub places: Range<usize>,
    pub count: usize,
}

/// A valid instance.
#[derive(Debug, Clone)]
pub struct Instance {
    /// The team.
    pub robots: Vec<Robot>,
    /// What is to be done.
    pub tasks: Vec<Task>,
    /// For each task, the robots that can fill any of its needs, by number, or group by group.
    pub(crate) able: Vec<Vec<u8>>,
    /// For each task, its needs by skill; none where a robot of the team can fill needs of two skills.
    pub(crate) groups: Vec<Vec<Group>>,
    /// Time to each task from each place. Places are the depots of all robots, then all tasks.
    travel: Vec<f64>,
}

impl Instance {
    /// Checks an instance.
    ///
    /// # Errors
    /// [`Error::Instance`], which names the robot or task and what is allowed.
    pub fn new(speed: f64, robots: Vec<Robot>, tasks: Vec<Task>) -> Result<Self> {
        within("speed".into(), speed, LEAST_SPEED, MOST)?;
        counted("robots", robots.len(), MAX_ROBOTS)?;
        counted("tasks", tasks.len(), MAX_TASKS)?;
        for (index, robot) in robots.iter().enumerate() {
            for coordinate in robot.depot {
                within(format!("robots[{index}].depot"), coordinate, -MOST, MOST)?;
            }
        }
        for (index, task) in tasks.iter().enumerate() {
            for coordinate in task.position {
                within(format!("tasks[{index}].position"), coordinate, -MOST, MOST)?;
            }
            within(format!("tasks[{index}].duration"), task.duration, 0.0, MOST)?;
            check_needs(index, task, &robots)?;
        }
        let depots = robots.iter().map(|robot| robot.depot);
        let places: Vec<[f64; 2]> = depots.chain(tasks.iter().map(|task| task.position)).collect();
        let times = |task: &Task| {
            places.iter().map(|from| distance(*from, task.position) / speed).collect::<Vec<_>>()
        };
        let travel = tasks.iter().flat_map(times).collect();
        let (able, groups) = tasks.iter().map(|task| able_robots(task, &robots)).unzip();
        Ok(Self { robots, tasks, able, groups, travel })
    }

    /// Time from a place to a task; see [`Self::place_of`].
    #[must_use]
    pub fn travel(&self, place: usize, task: usize) -> f64 {
        self.travel_to(task)[place]
    }

    /// Times from all places to a task.
    pub(crate) fn travel_to(&self, task: usize) -> &[f64] {
        let places = self.robots.len() + self.tasks.len();
        &self.travel[task * places..(task + 1) * places]
    }

    /// The number of a task's place. That of a robot's depot is the robot's.
    #[must_use]
    pub fn place_of(&self, task: usize) -> usize {
        self.robots.len() + task
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (x, y) = (a[0] - b[0], a[1] - b[1]);
    (x * x + y * y).sqrt()
}

/// The robots that can fill needs of a task, and its groups.
fn able_robots(task: &Task, robots: &[Robot]) -> (Vec<u8>, Vec<Group>) {
    let with = |mask: u32| {
        (0..robots.len() as u8).filter(move |robot| robots[usize::from(*robot)].skills & mask != 0)
    };
    let needed = task.needs.iter().fold(0, |mask, skill| mask | 1 << skill);
    let able: Vec<u8> = with(needed).collect();
    if able.iter().any(|robot| (robots[usize::from(*robot)].skills & needed).count_ones() > 1) {
        return (able, vec![]);
    }
    let (mut able, mut groups) = (vec![], vec![]);
    for skill in (0..MAX_SKILLS as u8).filter(|skill| needed >> skill & 1 == 1) {
        let first = able.len();
        able.extend(with(1 << skill));
        let count = task.needs.iter().map(|need| usize::from(*need == skill)).sum();
        groups.push(Group { places: first..able.len(), count });
    }
    (able, groups)
}

fn check_needs(index: usize, task: &Task, robots: &[Robot]) -> Result<()> {
    let place = format!("tasks[{index}].skills");
    let refused = |rule: String| {
        Err(Error::Instance { place: place.clone(), value: format!("{:?}", task.needs), rule })
    };
    if task.needs.is_empty() || task.needs.len() > robots.len() {
        return refused(format!(
            "must be 1 to {} skills, one for each robot that the task needs",
            robots.len()
        ));
    }
    if let Some(skill) = task.needs.iter().find(|skill| usize::from(**skill) >= MAX_SKILLS) {
        return refused(format!("skill {skill} must be 0 to {}", MAX_SKILLS - 1));
    }
    let team = robots.iter().fold(0_u32, |mask, robot| mask | robot.skills);
    if let Some(skill) = task.needs.iter().find(|skill| team >> **skill & 1 == 0) {
        return refused(format!("no robot has skill {skill}"));
    }
    if !fills(task, robots, (0..robots.len()).collect::<Vec<_>>().as_slice()) {
        return refused("the team has not enough robots to fill all these needs at once".into());
    }
    Ok(())
}

fn within(place: String, value: f64, low: f64, high: f64) -> Result<()> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Error::Instance { place, value: format!("{value:?}"), rule: format!("must be {low:?} to {high:?}") })
}

fn counted(place: &str, count: usize, most: usize) -> Result<()> {
    if (1..=most).contains(&count) {
        return Ok(());
    }
    let rule = format!("must be 1 to {most}");
    Err(Error::Instance { place: format!("number of {place}"), value: count.to_string(), rule })
}
