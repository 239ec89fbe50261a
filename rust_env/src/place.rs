//! Random places: for obstacles, robots and victims. Sampling is bounded: if no draw is far enough
//! from everything, the farthest one is taken and the caller is told.

use crate::geometry::{Solid, Vec2};
use crate::rng::Stream;
use crate::robot::Body;
use crate::scenario::Scenario;

/// Most draws for one place.
pub const DRAWS: usize = 512;
/// Gap between robots, and between robots and solids, at an episode's start, m.
const START_GAP_M: f32 = 1e-3;

/// A solid and where it is.
pub type Placed<'a> = (&'a Solid, Vec2);

/// A place, and whether it keeps every distance asked for.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// The place, m.
    pub at: Vec2,
    /// Whether it is far enough from everything.
    pub clear: bool,
}

/// A uniform place within ±`half` on both axes whose `clearance` (m, negative if too near) is not
/// negative; after [`DRAWS`] draws the one with the largest.
fn draw(stream: &mut Stream, half: f32, clearance: impl Fn(Vec2) -> f32) -> Place {
    let mut best = (Vec2::zeros(), f32::NEG_INFINITY);
    for _ in 0..DRAWS {
        let at = Vec2::new(stream.between(-half, half), stream.between(-half, half));
        let room = clearance(at);
        if room >= 0.0 {
            return Place { at, clear: true };
        }
        if room > best.1 {
            best = (at, room);
        }
    }
    Place { at: best.0, clear: false }
}

/// The measures that placing needs, read off a valid scenario.
#[derive(Debug, Clone)]
pub struct Placing {
    arena: f32,
    spawn_clearance: f32,
    wall_clearance: f32,
}

impl Placing {
    /// The measures of a valid scenario.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self {
            arena: scenario.arena_half_width_m as f32,
            spawn_clearance: scenario.spawn_clearance_m as f32,
            wall_clearance: scenario.wall_clearance_m as f32,
        }
    }

    /// A place for an obstacle, clear of those already `placed`.
    pub fn obstacle(&self, stream: &mut Stream, solid: &Solid, placed: &[Placed]) -> Place {
        draw(stream, (self.arena - solid.reach()).max(0.0), |at| {
            smallest(placed.iter().map(|(other, centre)| other.distance(at - centre) - solid.reach()))
        })
    }

    /// Whether an obstacle without a given place may be there.
    #[must_use]
    pub fn may_be_obstacle(&self, solid: &Solid, at: Vec2) -> bool {
        at.amax() <= (self.arena - solid.reach()).max(0.0)
    }

    /// How far a victim may be from the centre on each axis, m.
    #[must_use]
    pub fn victim_reach(&self) -> f32 {
        self.arena - self.wall_clearance
    }

    /// Whether a victim may be there.
    #[must_use]
    pub fn may_be_victim(&self, at: Vec2) -> bool {
        at.amax() <= self.victim_reach()
    }

    /// A place for a robot, without overlap with solids and the `others` already placed.
    pub fn robot(
        &self,
        stream: &mut Stream,
        body: &Body,
        others: &[(&Body, Vec2)],
        solids: &[Placed],
    ) -> Place {
        draw(stream, self.arena - body.radius - START_GAP_M, |at| {
            let room = body.radius + START_GAP_M;
            let others = others.iter().map(|(other, centre)| (at - centre).norm() - other.radius - room);
            smallest(others.chain(solids.iter().map(|(solid, centre)| solid.distance(at - centre) - room)))
        })
    }

    /// A place for a victim: away from walls and solids, and from every robot.
    pub fn victim(&self, stream: &mut Stream, robots: &[Vec2], solids: &[Placed]) -> Place {
        draw(stream, self.victim_reach(), |at| {
            let robots = robots.iter().map(|robot| (at - robot).norm() - self.spawn_clearance);
            let solids =
                solids.iter().map(|(solid, centre)| solid.distance(at - centre) - self.wall_clearance);
            smallest(robots.chain(solids))
        })
    }
}

fn smallest(rooms: impl Iterator<Item = f32>) -> f32 {
    rooms.fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Purpose;
    use crate::robot::bodies;

    #[test]
    fn places_keep_their_distances() {
        let scenario = Scenario::default();
        let placing = Placing::new(&scenario);
        let team = bodies(&scenario);
        let mut stream = Stream::new(0, 0, 0, Purpose::Start);
        let solids = [Solid::Disc(0.3), Solid::Box(Vec2::new(0.2, 0.05))];
        for _ in 0..300 {
            let centre = placing.obstacle(&mut stream, &solids[1], &[(&solids[0], Vec2::zeros())]);
            assert!(centre.clear && solids[0].distance(centre.at) >= solids[1].reach());
            let placed = [(&solids[0], Vec2::zeros()), (&solids[1], centre.at)];
            let mut robots: Vec<(&Body, Vec2)> = vec![];
            for body in &team {
                let place = placing.robot(&mut stream, body, &robots, &placed);
                assert!(place.clear && place.at.amax() + body.radius <= 1.0);
                assert!(robots.iter().all(|(other, at)| (at - place.at).norm() > other.radius + body.radius));
                assert!(placed.iter().all(|(solid, at)| solid.distance(place.at - at) > body.radius));
                robots.push((body, place.at));
            }
            let robots: Vec<Vec2> = robots.iter().map(|(_, at)| *at).collect();
            let victim = placing.victim(&mut stream, &robots, &placed);
            assert!(victim.clear && victim.at.amax() <= 0.9);
            assert!(robots.iter().all(|robot| (robot - victim.at).norm() >= 0.2));
            assert!(placed.iter().all(|(solid, at)| solid.distance(victim.at - at) >= 0.1));
        }
    }

    #[test]
    fn a_crowded_arena_is_told_and_the_roomiest_draw_taken() {
        let scenario = Scenario { spawn_clearance_m: 9.0, ..Scenario::default() };
        let placing = Placing::new(&scenario);
        let mut stream = Stream::new(0, 0, 0, Purpose::Start);
        let place = placing.victim(&mut stream, &[Vec2::new(-0.9, -0.9)], &[]);
        assert!(!place.clear && place.at.x > 0.7 && place.at.y > 0.7, "{place:?}");
    }
}
