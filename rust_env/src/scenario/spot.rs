//! Spots that robots come to, and their rules: stations and depots. They are not solid.

use super::check::{broken, counts, within};
use super::{MAX_STATIONS, Obstacle, Robot, Scenario, Shape};
use crate::error::Result;

/// How near to a spot the centre of a robot must be unless a scenario says so, m.
pub fn default_radius_m() -> f64 {
    0.15
}

impl Scenario {
    /// Refuses spots (places and radii, m) of `list` that are too many, of no use to any robot that is `served`,
    /// or where none of these can come. `what` such robots have.
    pub(super) fn validate_spots(
        &self,
        list: &str,
        spots: &[([f64; 2], f64)],
        served: impl Fn(&Robot) -> bool,
        what: &str,
    ) -> Result<()> {
        let number = format!("{list} (their number)");
        counts(&number, spots.len(), 0, MAX_STATIONS)?;
        let radii = self.robots.iter().filter(|robot| served(robot)).map(|robot| robot.radius_m);
        let smallest = radii.fold(f64::INFINITY, f64::min);
        if !spots.is_empty() && smallest.is_infinite() {
            return broken(&number, &spots.len(), &format!("must be 0: no robot has a {what}"));
        }
        let keeps_off = |one: &Obstacle| {
            self.robots.iter().filter(|robot| served(robot)).all(|robot| one.blocks(&robot.layer))
        };
        let map_keeps_off = self.map.as_ref().filter(|map| {
            self.robots.iter().filter(|robot| served(robot)).all(|robot| map.blocks(&robot.layer))
        });
        let half = self.arena_half_width_m;
        let beyond = |at: f64| (at.abs() - (half - smallest)).max(0.0);
        for (index, (at, radius_m)) in spots.iter().enumerate() {
            let key = |name: &str| format!("{list}[{index}].{name}");
            for (axis, value) in at.iter().enumerate() {
                within(&key(&format!("position_m[{axis}]")), *value, -half, half, "m")?;
            }
            within(&key("radius_m"), *radius_m, 0.001, 10.0, "m")?;
            let value = format!("{at:?}");
            if let Some(obstacle) = self.obstacles.iter().position(|one| holds(one, *at) && keeps_off(one)) {
                return broken(&key("position_m"), &value, &format!("is inside obstacles[{obstacle}]"));
            }
            if map_keeps_off.is_some_and(|map| map.holds(*at, half)) {
                return broken(&key("position_m"), &value, "is inside a solid cell of the map");
            }
            if beyond(at[0]).hypot(beyond(at[1])) > *radius_m {
                let rule = format!(
                    "is farther than radius_m from where robots with a {what} can be; walls keep them off"
                );
                return broken(&key("position_m"), &value, &rule);
            }
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
