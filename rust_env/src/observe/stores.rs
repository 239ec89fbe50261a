//! What robots use up, as columns: charges and loads, and the ways to the nearest station and depot.

use super::Scene;
use crate::energy::Energy;
use crate::geometry::Vec2;
use crate::scenario::Scenario;
use crate::supply::Supplies;

/// The batteries and loads of a scenario, one of them at least.
#[derive(Debug, Clone)]
pub struct Stores {
    energy: Option<Energy>,
    supplies: Option<Supplies>,
}

impl Stores {
    /// Those of a valid scenario, if there are any.
    pub fn new(scenario: &Scenario) -> Option<Self> {
        let found = Self { energy: Energy::new(scenario), supplies: Supplies::new(scenario) };
        (found.robot_width() > 0).then_some(found)
    }

    /// Columns in the block of each robot.
    pub fn robot_width(&self) -> usize {
        usize::from(self.energy.is_some()) + usize::from(self.supplies.is_some())
    }

    /// Columns of ways.
    pub fn ways_width(&self) -> usize {
        let stations = self.energy.as_ref().is_some_and(Energy::has_stations);
        let depots = self.supplies.as_ref().is_some_and(Supplies::has_depots);
        2 * (usize::from(stations) + usize::from(depots))
    }

    /// Names of the columns of each robot.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.energy.iter().map(|_| "charge").chain(self.supplies.iter().map(|_| "load"))
    }

    /// Names of the columns of ways.
    pub fn names_of_ways(&self) -> impl Iterator<Item = String> {
        let stations = self.energy.iter().filter(|one| one.has_stations()).map(|_| "station");
        let depots = self.supplies.iter().filter(|one| one.has_depots()).map(|_| "depot");
        stations.chain(depots).flat_map(|spot| ["x", "y"].map(|axis| format!("own.{spot}.{axis}")))
    }

    /// Writes what a robot has, as shares.
    pub fn write(&self, scene: Scene, robot: usize, columns: &mut [f32]) {
        let charge = self.energy.iter().map(|energy| energy.share(robot, scene.charges));
        let load = self.supplies.iter().map(|supplies| supplies.share(robot, scene.loads));
        columns.iter_mut().zip(charge.chain(load)).for_each(|(column, share)| *column = share);
    }

    /// Writes the ways to the nearest station and depot from a place, m.
    pub fn write_ways(&self, from: Vec2, columns: &mut [f32]) {
        let station = self.energy.iter().filter_map(|energy| energy.nearest_station(from));
        let depot = self.supplies.iter().filter_map(|supplies| supplies.nearest_depot(from));
        for (pair, way) in columns.chunks_exact_mut(2).zip(station.chain(depot)) {
            pair.copy_from_slice(&[way.x, way.y]);
        }
    }
}
