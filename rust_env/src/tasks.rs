//! Victims and what becomes of them: who is present, what it needs, which robots rescue it. How long that
//! takes is in `service.rs`, until when there is time in `deadline.rs`, who waits for whom in `order.rs`, needs
//! as sums in `sums.rs`, how many come by themselves in `arrivals.rs`.
//!
//! A step settles them in this order: robots have moved; slot by slot, service goes on and victims are
//! rescued; those whose deadline has come are lost; new ones appear.

pub mod arrivals;
pub mod deadline;
pub mod order;
pub mod service;
pub mod sums;

use serde::{Deserialize, Serialize};

use crate::geometry::Vec2;
use crate::matching::{bits, fillable};
use crate::robot::Body;
use crate::scenario::{MAX_HELPERS, MAX_NEEDS, Scenario, Task, steps_of};
use sums::Sums;

/// Robots that help one victim, in the order of its needs, or nearest first where these are sums.
pub type Helpers = [Option<u8>; MAX_HELPERS];

/// A victim that waits for help.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Victim {
    /// Number within the episode, from 0.
    pub id: u32,
    /// Index of its task.
    pub task: u32,
    /// Steps done in the episode when it appeared.
    pub appeared_step: u32,
    /// Where it is, m.
    pub position: Vec2,
    /// Steps of service that it has had. Images have it apart, where a scenario has services.
    #[serde(skip)]
    pub served_steps: u32,
    /// Steps done in the episode when it is lost; never for `u32::MAX`. It follows from the rest.
    #[serde(skip, default = "never")]
    pub deadline_step: u32,
}

fn never() -> u32 {
    u32::MAX
}

impl Victim {
    /// A victim that appears now: not served yet, and lost never, until its deadline is set.
    #[must_use]
    pub fn new(id: u32, task: u32, appeared_step: u32, position: Vec2) -> Self {
        Self { id, task, appeared_step, position, served_steps: 0, deadline_step: never() }
    }
}

/// A task's needs as ability numbers, in the order the scenario names them.
#[derive(Debug, Clone, PartialEq)]
pub struct Needs {
    abilities: Vec<u32>,
    /// Their amounts, where they are sums.
    sums: Option<Sums>,
}

impl Needs {
    /// The needs of every task of a valid scenario.
    #[must_use]
    pub(crate) fn of_tasks(scenario: &Scenario) -> Vec<Self> {
        let abilities = scenario.abilities();
        let number =
            |need: &str| abilities.iter().position(|ability| *ability == need).unwrap_or_default() as u32;
        let of = |task: &Task| Self {
            abilities: task.needs.names().map(number).collect(),
            sums: Sums::new(&task.needs, scenario),
        };
        scenario.tasks.iter().map(of).collect()
    }

    /// Ability numbers, one for each need.
    #[must_use]
    pub fn abilities(&self) -> &[u32] {
        &self.abilities
    }

    /// The amounts that helpers must reach together, where the needs are sums.
    #[must_use]
    pub fn sums(&self) -> Option<&Sums> {
        self.sums.as_ref()
    }

    /// How much of an ability is needed: the amount of a sum, or how many robots.
    #[must_use]
    pub fn amount(&self, ability: u32) -> f32 {
        let mut needs = self.abilities.iter();
        match &self.sums {
            Some(sums) => {
                needs.position(|need| *need == ability).map_or(0.0, |need| sums.needed()[need] as f32)
            }
            None => needs.filter(|need| **need == ability).count() as f32,
        }
    }

    /// Whether a robot with these abilities can fill any need.
    #[must_use]
    pub fn helped_by(&self, abilities: u32) -> bool {
        self.abilities.iter().any(|need| abilities >> need & 1 == 1)
    }

    /// Sum over needs of the distance of the nearest able robot, m; a need repeated k times counts
    /// the k nearest. Robots of the mask `away` do not count, and a need that is left without a robot
    /// adds nothing. Of a sum count the nearest robots that reach it, see [`Sums::distance`].
    #[must_use]
    pub fn distance(&self, victim: Vec2, team: &[Body], positions: &[Vec2], away: u64) -> f32 {
        if let Some(sums) = &self.sums {
            return sums.distance(victim, positions, away);
        }
        let mut total = 0.0;
        for (index, need) in self.abilities.iter().enumerate() {
            let rank = self.abilities[..index].iter().filter(|earlier| *earlier == need).count();
            total += kth_nearest(rank, *need, victim, team, positions, away);
        }
        total
    }

    /// The helpers that rescue a victim now: one distinct robot for each need, in the order of needs.
    /// Each need takes the nearest able robot in `radius` (ties by index) that is not `busy` and
    /// leaves every later need a robot of its own. `None` if no such team is near. For sums see
    /// [`Sums::helpers`].
    #[must_use]
    pub fn helpers(
        &self,
        victim: Vec2,
        team: &[Body],
        positions: &[Vec2],
        radius: f32,
        busy: u64,
    ) -> Option<Helpers> {
        if let Some(sums) = &self.sums {
            return sums.helpers(victim, positions, radius, busy);
        }
        let able = |need: u32| {
            let near = |robot: &usize| (positions[*robot] - victim).norm_squared() <= radius * radius;
            let can = |robot: &usize| (busy >> robot | u64::from(!team[*robot].abilities >> need)) & 1 == 0;
            (0..team.len()).filter(can).filter(near).fold(0_u64, |mask, robot| mask | 1 << robot)
        };
        let mut candidates = [0_u64; MAX_NEEDS];
        for (mask, need) in candidates.iter_mut().zip(&self.abilities) {
            *mask = able(*need);
            if *mask == 0 {
                return None;
            }
        }
        let candidates = &mut candidates[..self.abilities.len()];
        if !fillable(candidates) {
            return None;
        }
        let mut helpers = [None; MAX_HELPERS];
        for need in 0..candidates.len() {
            let mut open = candidates[need];
            while open != 0 {
                let nearest = nearest(open, victim, positions);
                open &= !(1 << nearest);
                let later = &mut candidates[need + 1..];
                let before: [u64; MAX_NEEDS] = std::array::from_fn(|i| later.get(i).copied().unwrap_or(0));
                for mask in later.iter_mut() {
                    *mask &= !(1 << nearest);
                }
                if fillable(later) {
                    helpers[need] = Some(nearest as u8);
                    break;
                }
                later.copy_from_slice(&before[..later.len()]);
            }
        }
        Some(helpers)
    }
}

/// The robot of `mask` nearest to the victim, ties by index.
fn nearest(mask: u64, victim: Vec2, positions: &[Vec2]) -> usize {
    let distance = |robot: usize| (positions[robot] - victim).norm_squared();
    bits(mask).min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or_default()
}

/// Distance of the able robot with `rank` nearer ones, m; 0 if there is none.
fn kth_nearest(rank: usize, need: u32, victim: Vec2, team: &[Body], positions: &[Vec2], away: u64) -> f32 {
    let can = |robot: usize| (away >> robot | u64::from(!team[robot].abilities >> need)) & 1 == 0;
    let able = (0..team.len()).filter(|robot| can(*robot));
    let squares = able.map(|robot| (positions[robot] - victim).norm_squared());
    if rank == 0 {
        let nearest = squares.fold(f32::INFINITY, f32::min);
        return if nearest.is_finite() { nearest.sqrt() } else { 0.0 };
    }
    let mut sorted: Vec<f32> = squares.collect();
    sorted.sort_unstable_by(f32::total_cmp);
    sorted.get(rank).map_or(0.0, |square| square.sqrt())
}

/// A rescue: which victim, when and by whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rescue {
    /// Index of the env in the batch.
    pub env: u32,
    /// Episode of that env, from 0.
    pub episode: u64,
    /// Step of the episode, from 0.
    pub step: u32,
    /// Slot in which the victim was.
    pub slot: u32,
    /// The victim's number within the episode.
    pub victim: u32,
    /// Index of its task.
    pub task: u32,
    /// Who helped.
    pub helpers: Helpers,
}

/// A victim that was lost: which, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Loss {
    /// Index of the env in the batch.
    pub env: u32,
    /// Episode of that env, from 0.
    pub episode: u64,
    /// Step of the episode, from 0.
    pub step: u32,
    /// Slot in which the victim was.
    pub slot: u32,
    /// The victim's number within the episode.
    pub victim: u32,
    /// Index of its task.
    pub task: u32,
}

/// What became of victims in a step.
#[derive(Debug, Clone, Default)]
pub struct Events {
    /// Those that were rescued.
    pub rescues: Vec<Rescue>,
    /// Those that were lost.
    pub losses: Vec<Loss>,
    /// The env of each that arrived when all slots of its task were taken.
    pub turned_away: Vec<u32>,
}

impl Events {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.rescues.clear();
        self.losses.clear();
        self.turned_away.clear();
    }
}

#[cfg(test)]
mod rule_tests;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::bodies;

    /// The default team around a victim at the centre: food at 0.1 and 0.12, information at 0.05,
    /// medicine at 0.14.
    fn around() -> (Vec<Body>, Vec<Needs>, [Vec2; 4]) {
        let scenario = Scenario::default();
        let at = [Vec2::new(0.1, 0.0), Vec2::new(0.0, 0.12), Vec2::new(-0.05, 0.0), Vec2::new(0.0, -0.14)];
        (bodies(&scenario), Needs::of_tasks(&scenario), at)
    }

    fn named(helpers: Option<Helpers>) -> Option<Vec<u8>> {
        helpers.map(|helpers| helpers.iter().flatten().copied().collect())
    }

    #[test]
    fn the_nearest_able_robots_help() {
        let (team, tasks, at) = around();
        let helpers =
            |task: usize, radius, busy| named(tasks[task].helpers(Vec2::zeros(), &team, &at, radius, busy));
        assert_eq!(helpers(0, 0.15, 0), Some(vec![0, 3]));
        assert_eq!(helpers(1, 0.15, 0), Some(vec![0, 2]));
        assert_eq!(helpers(0, 0.15, 0b0001), Some(vec![1, 3]), "food_0 is busy");
        assert_eq!(helpers(0, 0.15, 0b1000), None, "medical_0 is busy");
        assert_eq!(helpers(0, 0.13, 0), None, "medical_0 is too far");
        assert_eq!(helpers(0, 0.14, 0), Some(vec![0, 3]), "at the very radius");
    }

    #[test]
    fn a_robot_of_many_abilities_is_left_to_the_need_that_has_no_other() {
        let (mut team, tasks, mut at) = around();
        team[3].abilities |= team[0].abilities;
        at[3] = Vec2::new(0.01, 0.0);
        assert_eq!(named(tasks[0].helpers(Vec2::zeros(), &team, &at, 0.15, 0)), Some(vec![0, 3]));
        assert_eq!(named(tasks[1].helpers(Vec2::zeros(), &team, &at, 0.15, 0)), Some(vec![3, 2]));
    }

    #[test]
    fn distances_are_those_of_the_nearest_for_each_need() {
        let (team, tasks, at) = around();
        assert!((tasks[0].distance(Vec2::zeros(), &team, &at, 0) - 0.24).abs() < 1e-6);
        assert!((tasks[0].distance(Vec2::zeros(), &team, &at, 0b0001) - 0.26).abs() < 1e-6, "food_0 is away");
        assert!((tasks[0].distance(Vec2::zeros(), &team, &at, 0b0011) - 0.14).abs() < 1e-6, "no food");
        let mut twice = Scenario::default();
        twice.tasks[0].needs = vec!["food".into(), "medicine".into(), "food".into()].into();
        let twice = Needs::of_tasks(&twice).remove(0);
        assert!((twice.distance(Vec2::zeros(), &team, &at, 0) - 0.36).abs() < 1e-6);
        assert!((twice.distance(Vec2::zeros(), &team, &at, 0b0001) - 0.26).abs() < 1e-6);
    }
}
