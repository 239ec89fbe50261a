//! Instances: where robots and tasks are, who can do what, and how long it takes to get anywhere. Checked
//! once; everything else in the crate trusts it.

use crate::coalition::{Candidates, fills};
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

/// A valid instance.
#[derive(Debug, Clone)]
pub struct Instance {
    /// The team.
    pub robots: Vec<Robot>,
    /// What is to be done.
    pub tasks: Vec<Task>,
    /// For each task, the robots that can fill its needs.
    pub(crate) candidates: Vec<Candidates>,
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
        let skills: Vec<u32> = robots.iter().map(|robot| robot.skills).collect();
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
            check_needs(index, &task.needs, &skills)?;
        }
        let depots = robots.iter().map(|robot| robot.depot);
        let places: Vec<[f64; 2]> = depots.chain(tasks.iter().map(|task| task.position)).collect();
        let times = |task: &Task| {
            places.iter().map(|from| distance(*from, task.position) / speed).collect::<Vec<_>>()
        };
        let travel = tasks.iter().flat_map(times).collect();
        let candidates = tasks.iter().map(|task| Candidates::new(&task.needs, &skills)).collect();
        Ok(Self { robots, tasks, candidates, travel })
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

fn check_needs(index: usize, needs: &[u8], skills: &[u32]) -> Result<()> {
    let place = format!("tasks[{index}].skills");
    let refused =
        |rule: String| Err(Error::Instance { place: place.clone(), value: format!("{needs:?}"), rule });
    if needs.is_empty() || needs.len() > skills.len() {
        return refused(format!(
            "must be 1 to {} skills, one for each robot that the task needs",
            skills.len()
        ));
    }
    if let Some(skill) = needs.iter().find(|skill| usize::from(**skill) >= MAX_SKILLS) {
        return refused(format!("skill {skill} must be 0 to {}", MAX_SKILLS - 1));
    }
    let team = skills.iter().fold(0_u32, |mask, skills| mask | skills);
    if let Some(skill) = needs.iter().find(|skill| team >> **skill & 1 == 0) {
        return refused(format!("no robot has skill {skill}"));
    }
    if !fills(needs, skills, (0..skills.len()).collect::<Vec<_>>().as_slice()) {
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
