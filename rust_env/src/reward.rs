//! Rewards: what each robot gets for a step, by component. To change or add one, change its row of
//! [`COMPONENTS`].

use crate::geometry::Vec2;
use crate::robot::Body;
use crate::scenario::{RescueCredit, Scenario, Shaping};
use crate::tasks::{Loss, Needs, Rescue, Victim};

/// One term of a robot's reward.
pub struct Component {
    /// Its name, as in `reward_component_names`.
    pub name: &'static str,
    /// What it rewards, in a few words.
    pub meaning: &'static str,
    /// What a robot (its index) gets for a step.
    pub value: fn(&Weights, &Happened, usize) -> f32,
}

/// The terms of a robot's reward, in the order of their columns.
pub const COMPONENTS: &[Component] = &[
    Component {
        name: "rescue",
        meaning: "`rescue_reward` for each rescue that the robot is credited with",
        value: |weights, happened, robot| {
            let credited = |rescue: &&Rescue| match weights.credit {
                RescueCredit::Team => true,
                RescueCredit::Helpers => rescue.helpers.contains(&Some(robot as u8)),
            };
            weights.rescue * happened.rescues.iter().filter(credited).count() as f32
        },
    },
    Component {
        name: "progress",
        meaning: "`shaping_weight` for each metre that the team's nearest able robots came nearer to victims",
        value: |weights, happened, _| {
            let nearer = match weights.shaping {
                Shaping::Progress => happened.distance_before - happened.distance_after,
                Shaping::Potential => happened.distance_before - weights.discount * happened.distance_after,
                Shaping::None => 0.0,
            };
            weights.shaping_weight * nearer
        },
    },
    Component {
        name: "contact",
        meaning: "minus `contact_cost` where the robot touched something",
        value: |weights, happened, robot| -weights.contact * (happened.touched >> robot & 1) as f32,
    },
    Component {
        name: "action",
        meaning: "minus `action_cost` times the squared length of the robot's drive",
        value: |weights, happened, robot| -weights.action * happened.effort[robot],
    },
    Component {
        name: "lost",
        meaning: "minus `lost_cost` for each victim that is lost, for every robot",
        value: |weights, happened, _| -weights.lost * happened.losses.len() as f32,
    },
];

/// Number C of reward components.
pub const NUM_COMPONENTS: usize = COMPONENTS.len();

/// The weights of a scenario's rewards.
#[derive(Debug, Clone)]
pub struct Weights {
    /// Who is rewarded for a rescue.
    pub credit: RescueCredit,
    /// For a rescue.
    pub rescue: f32,
    /// The dense term's form.
    pub shaping: Shaping,
    /// For a metre of progress.
    pub shaping_weight: f32,
    /// γ of potential shaping.
    pub discount: f32,
    /// Cost of a step with a contact.
    pub contact: f32,
    /// Cost of a step of full drive.
    pub action: f32,
    /// Cost of a victim that is lost.
    pub lost: f32,
}

/// What happened in a step, as far as rewards care.
pub struct Happened<'a> {
    /// Rescues of this step.
    pub rescues: &'a [Rescue],
    /// Victims that were lost in it.
    pub losses: &'a [Loss],
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
    /// The weights of a valid scenario.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self {
            credit: scenario.rescue_credit,
            rescue: scenario.rescue_reward as f32,
            shaping: scenario.shaping,
            shaping_weight: scenario.shaping_weight as f32,
            discount: scenario.shaping_discount as f32,
            contact: scenario.contact_cost as f32,
            action: scenario.action_cost as f32,
            lost: scenario.lost_cost as f32,
        }
    }
}

/// Writes each robot's components into `components` (R × [`NUM_COMPONENTS`]) and their sums into
/// `reward` (R).
pub fn write(weights: &Weights, happened: &Happened, components: &mut [f32], reward: &mut [f32]) {
    for (robot, (row, sum)) in components.chunks_exact_mut(NUM_COMPONENTS).zip(reward).enumerate() {
        // By their numbers, which are known when this is compiled: then no call is left.
        let values: [f32; NUM_COMPONENTS] =
            std::array::from_fn(|one| (COMPONENTS[one].value)(weights, happened, robot));
        row.copy_from_slice(&values);
        *sum = values.iter().sum();
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
    use crate::scenario::MAX_HELPERS;

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
            lost_cost: 0.25,
            ..Scenario::default()
        };
        change(&mut scenario);
        let mut helpers = [None; MAX_HELPERS];
        (helpers[0], helpers[1]) = (Some(1), Some(3));
        let rescue = Rescue { env: 0, episode: 0, step: 0, slot: 0, victim: 0, task: 0, helpers };
        let happened = Happened {
            rescues: &[rescue],
            losses: &[Loss { env: 0, episode: 0, step: 0, slot: 1, victim: 1, task: 0 }; 2],
            distance_before: 2.0,
            distance_after: 1.5,
            touched: 0b0100,
            effort: &[1.0, 0.25, 0.0, 0.0],
        };
        let (mut rows, mut reward) = ([[0.0; NUM_COMPONENTS]; 4], [0.0; 4]);
        write(&Weights::new(&scenario), &happened, rows.as_flattened_mut(), &mut reward);
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
        assert_eq!(column(rows, 4), [-500; 4]);
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
