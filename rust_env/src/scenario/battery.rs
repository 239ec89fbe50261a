//! Batteries of robots and the stations that charge them, and the rules of both.

use serde::{Deserialize, Serialize};

use super::check::{broken, within};
use super::spot::default_radius_m;
use super::{Robot, Scenario, Situation};
use crate::error::Result;

/// Largest capacity of a battery, J.
const MAX_ENERGY_J: f64 = 1e9;
/// Largest use of energy, in J/m or W, and largest power of a station, W.
const MAX_RATE: f64 = 1e6;

/// What a robot's drive and electronics live on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Battery {
    /// Energy when an episode starts, and the most that it holds, J.
    pub capacity_j: f64,
    /// Energy used for each metre, J/m.
    #[serde(default)]
    pub per_m_j: f64,
    /// Power used all the time, W.
    #[serde(default)]
    pub idle_w: f64,
}

/// A place that charges the robots that stand on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Station {
    /// Place of its centre, m.
    pub position_m: [f64; 2],
    /// How near to it the centre of a robot must be, m.
    #[serde(default = "default_radius_m")]
    pub radius_m: f64,
    /// Power that each robot there gets, W.
    pub recharge_w: f64,
}

impl Scenario {
    /// Whether some robots have a battery.
    #[must_use]
    pub fn has_batteries(&self) -> bool {
        self.robots.iter().any(|robot| robot.battery.is_some())
    }

    /// Refuses batteries and stations out of range, and those that are of no use whatever happens.
    pub(super) fn validate_batteries(&self) -> Result<()> {
        for index in 0..self.robots.len() {
            self.validate_battery(index)?;
        }
        for (index, station) in self.stations.iter().enumerate() {
            within(&format!("stations[{index}].recharge_w"), station.recharge_w, 1e-3, MAX_RATE, "W")?;
        }
        let spots: Vec<_> = self.stations.iter().map(|one| (one.position_m, one.radius_m)).collect();
        self.validate_spots("stations", &spots, |robot| robot.battery.is_some(), "battery")
    }

    fn validate_battery(&self, index: usize) -> Result<()> {
        let robot = &self.robots[index];
        let Some(Battery { capacity_j, per_m_j, idle_w }) = robot.battery else { return Ok(()) };
        let key = |name: &str| format!("robots[{index}].battery.{name}");
        within(&key("capacity_j"), capacity_j, 1e-3, MAX_ENERGY_J, "J")?;
        within(&key("per_m_j"), per_m_j, 0.0, MAX_RATE, "J/m")?;
        within(&key("idle_w"), idle_w, 0.0, MAX_RATE, "W")?;
        if per_m_j == 0.0 && idle_w == 0.0 {
            return broken(
                &key("per_m_j"),
                &per_m_j,
                "must be above 0 where idle_w is 0, or nothing is used",
            );
        }
        if !self.stations.is_empty() {
            return Ok(());
        }
        let way = self.least_way(robot);
        // One step, at least, in which it would help.
        let least = per_m_j * way + idle_w * (way / robot.max_speed_mps).max(self.dt_s);
        if capacity_j <= least {
            let rule = format!(
                "must be above {least:.6} J, or {:?} can help no victim: the first is at least {way:.6} m away, and \
                 no station charges it",
                robot.name
            );
            return broken(&key("capacity_j"), &capacity_j, &rule);
        }
        Ok(())
    }

    /// How far a robot has to drive at least to its first victim, m.
    fn least_way(&self, robot: &Robot) -> f64 {
        let arrivals = self.arrivals.iter().map(|arrival| &arrival.position_m);
        let places: Vec<&[f64; 2]> = self.victim_places_m.iter().chain(arrivals).collect();
        let distance = |start: [f64; 2], at: &[f64; 2]| (start[0] - at[0]).hypot(start[1] - at[1]);
        let nearest = match robot.start_m {
            Some(start) if !places.is_empty() => {
                places.into_iter().map(|at| distance(start, at)).fold(f64::INFINITY, f64::min)
            }
            _ if self.situation == Situation::Listed => 0.0,
            _ => self.spawn_clearance_m,
        };
        (nearest - self.rescue_radius_m).max(0.0)
    }
}
