//! Batteries of robots and the stations that charge them, and the rules of both.

use serde::{Deserialize, Serialize};

use super::check::{broken, counts, within};
use super::{MAX_STATIONS, Obstacle, Robot, Scenario, Shape, Situation};
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

fn default_radius_m() -> f64 {
    0.15
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
        counts("stations (their number)", self.stations.len(), 0, MAX_STATIONS)?;
        if !self.stations.is_empty() && !self.has_batteries() {
            return broken(
                "stations (their number)",
                &self.stations.len(),
                "must be 0: no robot has a battery",
            );
        }
        (0..self.stations.len()).try_for_each(|index| self.validate_station(index))
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

    fn validate_station(&self, index: usize) -> Result<()> {
        let Station { position_m, radius_m, recharge_w } = self.stations[index];
        let key = |name: &str| format!("stations[{index}].{name}");
        let half = self.arena_half_width_m;
        for (axis, value) in position_m.iter().enumerate() {
            within(&key(&format!("position_m[{axis}]")), *value, -half, half, "m")?;
        }
        within(&key("radius_m"), radius_m, 0.001, 10.0, "m")?;
        within(&key("recharge_w"), recharge_w, 1e-3, MAX_RATE, "W")?;
        let value = format!("{position_m:?}");
        if let Some(obstacle) = self.obstacles.iter().position(|one| holds(one, position_m)) {
            return broken(&key("position_m"), &value, &format!("is inside obstacles[{obstacle}]"));
        }
        let powered = self.robots.iter().filter(|robot| robot.battery.is_some());
        let smallest = powered.map(|robot| robot.radius_m).fold(f64::INFINITY, f64::min);
        let beyond = |at: f64| (at.abs() - (half - smallest)).max(0.0);
        if beyond(position_m[0]).hypot(beyond(position_m[1])) > radius_m {
            let rule =
                "is farther than radius_m from where robots with a battery can be; walls keep them off";
            return broken(&key("position_m"), &value, rule);
        }
        Ok(())
    }
}

/// Whether an obstacle with a given place covers a point.
fn holds(obstacle: &Obstacle, at: [f64; 2]) -> bool {
    let Some([x, y]) = obstacle.position_m else { return false };
    let (x, y) = ((at[0] - x).abs(), (at[1] - y).abs());
    match obstacle.shape {
        Shape::Disc => obstacle.radius_m.is_some_and(|radius| x.hypot(y) < radius),
        Shape::Box => obstacle.half_extents_m.is_some_and(|[wide, high]| x < wide && y < high),
    }
}
