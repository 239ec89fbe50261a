//! A scenario made ready to play: every constant that worlds share, computed once.

use crate::error::Result;
use crate::geometry::Solid;
use crate::observe::Layout;
use crate::physics::Physics;
use crate::place::Placing;
use crate::reward::Weights;
use crate::robot::{Body, bodies};
use crate::scenario::Scenario;
use crate::task::Needs;

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
            scenario,
            team,
            tasks,
            solids,
        })
    }
}
