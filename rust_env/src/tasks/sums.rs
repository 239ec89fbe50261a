//! Needs as sums: what the helpers of a victim give must add up to an amount.

use super::{Helpers, nearest};
use crate::geometry::Vec2;
use crate::matching::bits;
use crate::scenario::{Abilities, MAX_HELPERS, Robot, Scenario, reaches};

/// The amounts that a task needs, in the order of its needs, and what each robot gives of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Sums {
    needed: Vec<f64>,
    /// By robot, in team order.
    given: Vec<Vec<f64>>,
}

impl Sums {
    /// The sums that `needs` ask of a valid scenario's team; `None` for a list.
    #[must_use]
    pub(crate) fn new(needs: &Abilities, scenario: &Scenario) -> Option<Self> {
        let amounts = needs.amounts()?;
        let of = |robot: &Robot| amounts.keys().map(|need| robot.abilities.amount(need)).collect();
        let given = scenario.robots.iter().map(of).collect();
        Some(Self { needed: amounts.values().copied().collect(), given })
    }

    /// Amounts, one for each need.
    #[must_use]
    pub fn needed(&self) -> &[f64] {
        &self.needed
    }

    /// The first need that these robots (bits) do not reach together, and what they reach.
    #[must_use]
    pub fn short_of(&self, robots: u64) -> Option<(usize, f64)> {
        let sum = |need: usize| bits(robots).map(|robot| self.given[robot][need]).sum::<f64>();
        (0..self.needed.len())
            .map(|need| (need, sum(need)))
            .find(|(need, sum)| !reaches(*sum, self.needed[*need]))
    }

    /// No fewer robots than these can reach all sums.
    #[must_use]
    pub fn fewest(&self) -> usize {
        let fewest = |need: usize| {
            let mut most: Vec<f64> = self.given.iter().map(|given| given[need]).collect();
            most.sort_unstable_by(|a, b| b.total_cmp(a));
            let reached = |count: &usize| reaches(most[..*count].iter().sum(), self.needed[need]);
            (0..=most.len()).find(reached).unwrap_or(most.len())
        };
        (0..self.needed.len()).map(fewest).max().unwrap_or(0)
    }

    /// Robots that give some of what is needed, as bits.
    #[must_use]
    pub fn able(&self) -> u64 {
        let able = |robot: &usize| self.given[*robot].iter().any(|amount| *amount > 0.0);
        (0..self.given.len()).filter(able).fold(0, |mask, robot| mask | 1 << robot)
    }

    /// The helpers that rescue a victim now, nearest first: robots in `radius` that are not `busy` are taken,
    /// nearest first (ties by index), until all sums are reached; then those that the others can do without
    /// are left out, farthest first. `None` if all together do not reach them.
    #[must_use]
    pub fn helpers(&self, victim: Vec2, positions: &[Vec2], radius: f32, busy: u64) -> Option<Helpers> {
        let near = |robot: &usize| (positions[*robot] - victim).norm_squared() <= radius * radius;
        let mut open = bits(self.able() & !busy).filter(near).fold(0_u64, |mask, robot| mask | 1 << robot);
        if self.short_of(open).is_some() {
            return None;
        }
        let (mut taken, mut chosen, mut count) = ([0_u8; MAX_HELPERS], 0_u64, 0);
        while self.short_of(chosen).is_some() {
            let robot = nearest(open, victim, positions);
            open &= !(1 << robot);
            chosen |= 1 << robot;
            taken[count] = robot as u8;
            count += 1;
        }
        for robot in taken[..count].iter().rev() {
            if self.short_of(chosen & !(1 << robot)).is_none() {
                chosen &= !(1 << robot);
            }
        }
        let mut helpers = [None; MAX_HELPERS];
        let kept = taken[..count].iter().filter(|robot| chosen >> **robot & 1 == 1);
        for (place, robot) in helpers.iter_mut().zip(kept) {
            *place = Some(*robot);
        }
        Some(helpers)
    }

    /// Sum over needs of the distances of the nearest robots that reach it, m; all that there are if they do
    /// not. Robots of the mask `away` do not count.
    #[must_use]
    pub fn distance(&self, victim: Vec2, positions: &[Vec2], away: u64) -> f32 {
        let mut total = 0.0;
        for need in 0..self.needed.len() {
            let gives = |robot: &usize| away >> robot & 1 == 0 && self.given[*robot][need] > 0.0;
            let mut open = (0..positions.len()).filter(gives).fold(0_u64, |mask, robot| mask | 1 << robot);
            let mut sum = 0.0;
            while open != 0 && !reaches(sum, self.needed[need]) {
                let robot = nearest(open, victim, positions);
                open &= !(1 << robot);
                sum += self.given[robot][need];
                total += (positions[robot] - victim).norm();
            }
        }
        total
    }
}
