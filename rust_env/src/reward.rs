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

/// Σ over victims and their needs of the distance of the nearest able robots that are not `away`, m.
pub fn total_distance<'a>(
    victims: impl Iterator<Item = &'a Victim>,
    tasks: &[Needs],
    team: &[Body],
    positions: &[Vec2],
    away: u64,
) -> f32 {
    victims.map(|victim| tasks[victim.task as usize].distance(victim.position, team, positions, away)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::MAX_NEEDS;

    /// One component of all robots, in thousandths.
    fn column(rows: [[f32; NUM_COMPONENTS]; 4], component: usize) -> [i32; 4] {
        rows.map(|row| (1000.0 * row[component]).round() as i32)
    }

    /// Components of a step of four robots in which the second and fourth rescued, the third was
    /// touched and the sum of distances went from 2.0 to 1.5.
    fn components(change: impl Fn(&mut Scenario)) -> [[f32; NUM_COMPONENTS]; 4] {
        let mut scenario = Scenario {
            rescue_reward: 10.0,
            shaping_weight: 2.0,
            shaping_discount: 0.5,
            contact_cost: 3.0,
            action_cost: 0.5,
            ..Scenario::default()
        };
        change(&mut scenario);
        let mut helpers = [None; MAX_NEEDS];
        (helpers[0], helpers[1]) = (Some(1), Some(3));
        let rescue = Rescue { env: 0, episode: 0, step: 0, slot: 0, victim: 0, task: 0, helpers };
        let happened = Happened {
            rescues: &[rescue],
            distance_before: 2.0,
            distance_after: 1.5,
            touched: 0b0100,
            effort: &[1.0, 0.25, 0.0, 0.0],
        };
        let (mut rows, mut reward) = ([[0.0; NUM_COMPONENTS]; 4], [0.0; 4]);
        Weights::new(&scenario).write(&happened, rows.as_flattened_mut(), &mut reward);
        for (row, reward) in rows.iter().zip(reward) {
            assert!((row.iter().sum::<f32>() - reward).abs() < 1e-6);
        }
        rows
    }

    #[test]
    fn each_component_goes_to_whom_it_should() {
        let rows = components(|_| ());
        assert_eq!(column(rows, 0), [0, 10_000, 0, 10_000]);
        assert_eq!(column(rows, 1), [1000; 4]);
        assert_eq!(column(rows, 2), [0, 0, -3000, 0]);
        assert_eq!(column(rows, 3), [-500, -125, 0, 0]);
    }

    #[test]
    fn credit_and_shaping_have_their_forms() {
        let team = components(|scenario| scenario.rescue_credit = RescueCredit::Team);
        assert_eq!(column(team, 0), [10_000; 4]);
        let potential = components(|scenario| scenario.shaping = Shaping::Potential);
        assert_eq!(column(potential, 1), [2500; 4], "2 (2 - 0.5 * 1.5)");
        let sparse = components(|scenario| scenario.shaping = Shaping::None);
        assert_eq!(column(sparse, 1), [0; 4]);
    }
}
