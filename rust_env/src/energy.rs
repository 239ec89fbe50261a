//! Energy: what robots with a battery use, what stations give them, and who has none left.

use crate::geometry::{Vec2, way_to_nearest};
use crate::scenario::{Scenario, Station};

/// The batteries and stations of a scenario.
#[derive(Debug, Clone)]
pub struct Energy {
    /// By robot; none for one that needs no energy.
    batteries: Vec<Option<Use>>,
    /// Place, radius, and energy that each robot there gets in a control period, J.
    stations: Vec<(Vec2, f32, f64)>,
}

/// What one battery holds, and what its robot takes from it.
#[derive(Debug, Clone, Copy)]
struct Use {
    /// Most energy that it holds, J.
    capacity: f64,
    /// Energy that is used for each metre, J/m.
    per_m: f64,
    /// Energy that is used in each control period, J.
    per_period: f64,
}

impl Energy {
    /// The batteries of a valid scenario; `None` where no robot has one.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let dt_s = scenario.dt_s;
        let batteries = scenario.robots.iter().map(|robot| {
            robot.battery.map(|battery| Use {
                capacity: battery.capacity_j,
                per_m: battery.per_m_j,
                per_period: battery.idle_w * dt_s,
            })
        });
        let station = |one: &Station| {
            let [x, y] = one.position_m.map(|metres| metres as f32);
            (Vec2::new(x, y), one.radius_m as f32, one.recharge_w * dt_s)
        };
        let stations = scenario.stations.iter().map(station).collect();
        scenario.has_batteries().then(|| Self { batteries: batteries.collect(), stations })
    }

    /// Whether there is any station.
    #[must_use]
    pub fn has_stations(&self) -> bool {
        !self.stations.is_empty()
    }

    /// Charges when an episode starts, J: full batteries, and 0 for robots without one.
    pub fn fill(&self, charges: &mut Vec<f64>) {
        charges.clear();
        charges.extend(self.batteries.iter().map(|battery| battery.map_or(0.0, |one| one.capacity)));
    }

    /// Accounts for a control period in which robots went from `before` to `after`: those that are not `absent`
    /// (as bits) use energy and are charged.
    pub fn account(&self, before: &[Vec2], after: &[Vec2], absent: u64, charges: &mut [f64]) {
        for (robot, charge) in charges.iter_mut().enumerate() {
            let Some(battery) = self.batteries[robot].filter(|_| absent >> robot & 1 == 0) else { continue };
            let way = f64::from((after[robot] - before[robot]).norm());
            let used = battery.per_m * way + battery.per_period;
            *charge = (*charge - used + self.given(after[robot])).clamp(0.0, battery.capacity);
        }
    }

    /// Energy that a robot at this place is given in a control period, J: that of the strongest station there.
    fn given(&self, at: Vec2) -> f64 {
        let here = self.stations.iter().filter(|(place, radius, _)| (at - place).norm() <= *radius);
        here.fold(0.0, |most, (.., energy)| energy.max(most))
    }

    /// Robots whose battery is empty, as bits.
    #[must_use]
    pub fn empty(&self, charges: &[f64]) -> u64 {
        let is_empty = |robot: &usize| self.batteries[*robot].is_some() && charges[*robot] <= 0.0;
        (0..charges.len()).filter(is_empty).fold(0, |mask, robot| mask | 1 << robot)
    }

    /// Share of its battery's capacity that a robot has; 1 for one without a battery.
    #[must_use]
    pub fn share(&self, robot: usize, charges: &[f64]) -> f32 {
        self.batteries[robot].map_or(1.0, |battery| (charges[robot] / battery.capacity) as f32)
    }

    /// The way from a place to the nearest station, m; ties by their order.
    #[must_use]
    pub fn nearest_station(&self, from: Vec2) -> Option<Vec2> {
        way_to_nearest(from, self.stations.iter().map(|(place, ..)| *place))
    }

    /// Whether robots may have these charges.
    #[must_use]
    pub fn may_be(&self, charges: &[f64]) -> bool {
        let most = |battery: &Option<Use>| battery.map_or(0.0, |one| one.capacity);
        let fits = |(battery, charge): (&Option<Use>, &f64)| (0.0..=most(battery)).contains(charge);
        charges.len() == self.batteries.len() && self.batteries.iter().zip(charges).all(fits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Battery;

    /// One robot of the default team with a battery, and two stations of 20 W and 5 W.
    fn energy() -> Energy {
        let mut scenario = Scenario::default();
        scenario.robots[1].battery = Some(Battery { capacity_j: 10.0, per_m_j: 4.0, idle_w: 5.0 });
        let station = |x: f64, recharge_w| Station { position_m: [x, 0.0], radius_m: 0.25, recharge_w };
        scenario.stations = vec![station(0.5, 20.0), station(0.75, 5.0)];
        Energy::new(&scenario).expect("a battery")
    }

    #[test]
    fn energy_goes_by_way_and_time_and_comes_from_the_strongest_station() {
        let energy = energy();
        let mut charges = vec![];
        energy.fill(&mut charges);
        assert_eq!(charges, [0.0, 10.0, 0.0, 0.0]);
        let at = |x: f32| [Vec2::new(x, 0.0); 4];
        energy.account(&at(0.0), &at(-0.25), 0, &mut charges);
        assert_eq!(charges[1].to_bits(), 8.5_f64.to_bits(), "1 J for the way and 0.5 J for the time");
        energy.account(&at(0.0), &at(-0.25), 0b10, &mut charges);
        assert_eq!(charges[1].to_bits(), 8.5_f64.to_bits(), "it is not there");
        energy.account(&at(0.625), &at(0.625), 0, &mut charges);
        assert_eq!(charges[1].to_bits(), 10.0_f64.to_bits(), "2 J given, but no more than it holds");
        charges[1] = 1.0;
        energy.account(&at(-0.5), &at(-0.75), 0, &mut charges);
        assert_eq!((energy.empty(&charges), charges[1].to_bits()), (0b10, 0.0_f64.to_bits()));
        energy.account(&at(0.875), &at(0.875), 0, &mut charges);
        assert_eq!(energy.empty(&charges), 0b10, "5 W are as much as it uses");
        assert_eq!(
            [0, 1].map(|robot| energy.share(robot, &charges).to_bits()),
            [1.0_f32, 0.0].map(f32::to_bits)
        );
    }

    #[test]
    fn the_nearest_station_is_seen() {
        let way = energy().nearest_station(Vec2::new(0.75, 0.5)).expect("a station");
        assert_eq!(way, Vec2::new(0.0, -0.5));
        assert!(Energy::new(&Scenario::default()).is_none());
    }
}
