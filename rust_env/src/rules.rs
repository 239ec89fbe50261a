//! A scenario made ready to play: every constant that worlds share, computed once.

use crate::error::Result;
use crate::fault::{HEALTHY, Kind};
use crate::geometry::Solid;
use crate::observe::Layout;
use crate::physics::Physics;
use crate::place::Placing;
use crate::reward::Weights;
use crate::robot::{Body, bodies};
use crate::scenario::Scenario;
use crate::task::Needs;

/// One of the scenario's faults, as numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process {
    /// Index of the robot.
    pub robot: usize,
    /// What goes wrong.
    pub kind: Kind,
    /// How badly.
    pub value: f32,
    /// Step at which it begins, or may begin.
    pub onset: u32,
    /// How often it begins in a control step, if at random.
    pub rate: Option<f32>,
    /// Steps it lasts; `u32::MAX` for ever.
    pub duration: u32,
}

/// What all worlds of a batch share.
pub struct Rules {
    /// The description it was made from.
    pub scenario: Scenario,
    /// The robots' constants, in team order.
    pub team: Vec<Body>,
    /// What each task needs.
    pub tasks: Vec<Needs>,
    /// The obstacles' forms.
    pub solids: Vec<Solid>,
    /// Motion and contacts.
    pub physics: Physics,
    /// Columns of an observation.
    pub layout: Layout,
    /// Weights of the rewards.
    pub weights: Weights,
    /// Distances kept when placing things.
    pub placing: Placing,
    /// The scenario's faults, but for those that leave their robot healthy.
    pub faults: Vec<Process>,
}

impl Rules {
    /// Checks a scenario and makes it ready.
    ///
    /// # Errors
    /// [`crate::error::Error::Scenario`] for the first rule that is broken.
    pub fn new(scenario: Scenario) -> Result<Self> {
        scenario.validate()?;
        let team = bodies(&scenario);
        let tasks = Needs::of_tasks(&scenario);
        let solids: Vec<Solid> = scenario.obstacles.iter().map(Solid::of).collect();
        Ok(Self {
            physics: Physics::new(&scenario, &team, &solids),
            layout: Layout::new(&scenario, &tasks),
            weights: Weights::new(&scenario),
            placing: Placing::new(&scenario)?,
            faults: processes(&scenario),
            scenario,
            team,
            tasks,
            solids,
        })
    }
}

#[allow(clippy::float_cmp)] // the healthy value itself, not one near it
fn processes(scenario: &Scenario) -> Vec<Process> {
    let index = |name: &String| scenario.robots.iter().position(|robot| robot.name == *name);
    scenario
        .faults
        .iter()
        .filter(|fault| fault.value as f32 != HEALTHY[fault.kind as usize]) // it would do nothing
        .map(|fault| Process {
            robot: index(&fault.robot).unwrap_or_default(),
            kind: fault.kind,
            value: fault.value as f32,
            onset: fault.onset_step,
            rate: fault.onset_rate_hz.map(|rate| (rate * scenario.dt_s) as f32),
            duration: fault.duration_steps.unwrap_or(u32::MAX),
        })
        .collect()
}
