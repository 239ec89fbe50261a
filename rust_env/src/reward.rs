//! Rewards: what each robot gets for a step, by component. To change a reward, change it here.

use crate::geometry::Vec2;
use crate::robot::Body;
use crate::scenario::{RescueCredit, Scenario, Shaping};
use crate::task::{Needs, Rescue, Victim};

/// Number of reward components.
pub const NUM_COMPONENTS: usize = 4;
/// Names of the reward components, in order.
pub const COMPONENTS: [&str; NUM_COMPONENTS] = ["rescue", "progress", "contact", "action"];

/// The weights of a scenario's rewards.
#[derive(Debug, Clone)]
pub struct Weights {
    credit: RescueCredit,
    rescue: f32,
    /// The dense term's form.
    pub shaping: Shaping,
    shaping_weight: f32,
    discount: f32,
    contact: f32,
    action: f32,
}

/// What happened in a step, as far as rewards care.
pub struct Happened<'a> {
    /// Rescues of this step.
    pub rescues: &'a [Rescue],
    /// Σ of needs' distances before the robots moved, m.
    pub distance_before: f32,
    /// The same after the step: over the same victims for progress, over those now present for
    /// potential shaping (0 once the episode has terminated).
    pub distance_after: f32,
    /// Robots that touched something, as bits.
    pub touched: u64,
    /// Squared length of each robot's drive, 0 to 1.
    pub effort: &'a [f32],
}

impl Weights {
    /// The weights of `scenario`.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            credit: scenario.rescue_credit,
            rescue: scenario.rescue_reward as f32,
            shaping: scenario.shaping,
            shaping_weight: scenario.shaping_weight as f32,
            discount: scenario.shaping_discount as f32,
            contact: scenario.contact_cost as f32,
            action: scenario.action_cost as f32,
        }
    }

    /// Writes each robot's components into `components` (R × [`NUM_COMPONENTS`]) and their sums into
    /// `reward` (R).
    pub fn write(&self, happened: &Happened, components: &mut [f32], reward: &mut [f32]) {
        let dense = match self.shaping {
            Shaping::Progress => happened.distance_before - happened.distance_after,
            Shaping::Potential => happened.distance_before - self.discount * happened.distance_after,
            Shaping::None => 0.0,
        };
        for (robot, row) in components.chunks_exact_mut(NUM_COMPONENTS).enumerate() {
            let helped = |rescue: &&Rescue| match self.credit {
                RescueCredit::Team => true,
                RescueCredit::Helpers => rescue.helpers.contains(&Some(robot as u8)),
            };
            let rescued = happened.rescues.iter().filter(helped).count();
            let touched = (happened.touched >> robot & 1) as f32;
            row[0] = self.rescue * rescued as f32;
            row[1] = self.shaping_weight * dense;
            row[2] = -self.contact * touched;
            row[3] = -self.action * happened.effort[robot];
            reward[robot] = row.iter().sum();
        }
    }
}

/// Σ over victims and their needs of the distance of the nearest able robots, m.
pub fn total_distance<'a>(
    victims: impl Iterator<Item = &'a Victim>,
    tasks: &[Needs],
    team: &[Body],
    positions: &[Vec2],
) -> f32 {
    victims.map(|victim| tasks[victim.task as usize].distance(victim.position, team, positions)).sum()
}
