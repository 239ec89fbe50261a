//! Supplies: what rescues take from the loads of robots, where depots refill them, and whose are used up.

use crate::geometry::{Vec2, way_to_nearest};
use crate::scenario::{Depot, Scenario};
use crate::tasks::Helpers;

/// The loads and depots of a scenario.
#[derive(Debug, Clone)]
pub struct Supplies {
    /// Full loads by robot; none for one that never runs out.
    full: Vec<Option<u32>>,
    /// Places and radii, m.
    depots: Vec<(Vec2, f32)>,
}

impl Supplies {
    /// The loads of a valid scenario; `None` where no robot has one.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let depot = |one: &Depot| {
            let [x, y] = one.position_m.map(|metres| metres as f32);
            (Vec2::new(x, y), one.radius_m as f32)
        };
        let depots = scenario.depots.iter().map(depot).collect();
        let full = scenario.robots.iter().map(|robot| robot.load).collect();
        scenario.has_loads().then_some(Self { full, depots })
    }

    /// Whether there is any depot.
    #[must_use]
    pub fn has_depots(&self) -> bool {
        !self.depots.is_empty()
    }

    /// Loads when an episode starts: full ones, and 0 for robots without one.
    pub fn fill(&self, loads: &mut Vec<u32>) {
        loads.clear();
        loads.extend(self.full.iter().map(|full| full.unwrap_or(0)));
    }

    /// Takes one from the load of each of those that helped with a rescue, if it has one.
    pub fn take(&self, helpers: &Helpers, loads: &mut [u32]) {
        for robot in helpers.iter().flatten().map(|robot| usize::from(*robot)) {
            loads[robot] -= u32::from(self.full[robot].is_some()); // who helps has some
        }
    }

    /// Fills the loads of the robots at a depot that are not `absent` (as bits).
    pub fn refill(&self, positions: &[Vec2], absent: u64, loads: &mut [u32]) {
        for (robot, load) in loads.iter_mut().enumerate() {
            let Some(full) = self.full[robot].filter(|_| absent >> robot & 1 == 0) else { continue };
            let is_here = |(place, radius): &(Vec2, f32)| (positions[robot] - place).norm() <= *radius;
            if *load < full && self.depots.iter().any(is_here) {
                *load = full;
            }
        }
    }

    /// Robots whose load is used up, as bits.
    #[must_use]
    pub fn used_up(&self, loads: &[u32]) -> u64 {
        let is_used_up = |robot: &usize| self.full[*robot].is_some() && loads[*robot] == 0;
        (0..loads.len()).filter(is_used_up).fold(0, |mask, robot| mask | 1 << robot)
    }

    /// Share of its full load that a robot has; 1 for one without a load.
    #[must_use]
    pub fn share(&self, robot: usize, loads: &[u32]) -> f32 {
        self.full[robot].map_or(1.0, |full| loads[robot] as f32 / full as f32)
    }

    /// The way from a place to the nearest depot, m; ties by their order.
    #[must_use]
    pub fn nearest_depot(&self, from: Vec2) -> Option<Vec2> {
        way_to_nearest(from, self.depots.iter().map(|(place, _)| *place))
    }

    /// Whether robots may have these loads.
    #[must_use]
    pub fn may_be(&self, loads: &[u32]) -> bool {
        let fits = |(full, load): (&Option<u32>, &u32)| *load <= full.unwrap_or(0);
        loads.len() == self.full.len() && self.full.iter().zip(loads).all(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::MAX_HELPERS;

    #[test]
    fn rescues_take_from_loads_and_depots_fill_them() {
        let mut scenario = Scenario::default();
        (scenario.robots[1].load, scenario.robots[3].load) = (Some(2), Some(1));
        scenario.depots = vec![Depot { position_m: [0.5, 0.0], radius_m: 0.25 }];
        let supplies = Supplies::new(&scenario).expect("loads");
        let mut loads = vec![];
        supplies.fill(&mut loads);
        assert_eq!((loads.as_slice(), supplies.used_up(&loads)), ([0, 2, 0, 1].as_slice(), 0));
        let mut helpers = [None; MAX_HELPERS];
        helpers[..3].copy_from_slice(&[Some(3), Some(0), Some(1)]);
        supplies.take(&helpers, &mut loads);
        assert_eq!((loads.as_slice(), supplies.used_up(&loads)), ([0, 1, 0, 0].as_slice(), 0b1000));
        let shares = [0, 1, 2, 3].map(|robot| supplies.share(robot, &loads).to_bits());
        assert_eq!(shares, [1.0_f32, 0.5, 1.0, 0.0].map(f32::to_bits));
        supplies.refill(&[Vec2::new(0.2, 0.0); 4], 0, &mut loads);
        supplies.refill(&[Vec2::new(0.75, 0.0); 4], 0b1000, &mut loads);
        assert_eq!(loads, [0, 2, 0, 0], "nobody is near; then one is not there");
        assert_eq!(supplies.nearest_depot(Vec2::new(0.0, 1.0)), Some(Vec2::new(0.5, -1.0)));
        assert!(
            supplies.may_be(&loads) && !supplies.may_be(&[0, 3, 0, 0]) && !supplies.may_be(&[1, 0, 0, 0])
        );
        assert!(Supplies::new(&Scenario::default()).is_none());
    }
}
