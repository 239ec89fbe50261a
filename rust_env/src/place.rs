//! Random places: for obstacles, robots and victims. Sampling is bounded: if no draw is far enough
//! from everything, the farthest one is taken and the caller is told.

use crate::blocks::Blocks;
use crate::geometry::{Solid, Vec2};
use crate::rng::Stream;
use crate::robot::Body;
use crate::scenario::{self, Scenario, Task};

/// Most draws for one place.
pub const DRAWS: usize = 512;
const START_GAP_M: f32 = scenario::START_GAP_M as f32;
/// Less room than any place has whose distances are counted, m.
const TAKEN: f32 = -1e9;

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

/// Where draws come from; at most two words of a stream each.
#[derive(Debug, Clone)]
enum Region {
    /// Everywhere between a corner with the least and one with the largest coordinates.
    Area(Vec2, Vec2),
    /// One of these, each with the same chance.
    OneOf(Vec<Vec2>),
}

impl Region {
    /// Within ±`half` on both axes.
    fn square(half: f32) -> Self {
        Self::Area(Vec2::repeat(-half), Vec2::repeat(half))
    }

    fn draw(&self, stream: &mut Stream) -> Vec2 {
        match self {
            Self::Area(low, high) => Vec2::new(stream.between(low.x, high.x), stream.between(low.y, high.y)),
            Self::OneOf(places) => places[stream.below(places.len())],
        }
    }
}

/// A uniform place of a region whose `clearance` (m, negative if too near) is not negative; after
/// [`DRAWS`] draws the one with the largest.
fn draw(stream: &mut Stream, region: &Region, clearance: impl Fn(Vec2) -> f32) -> Place {
    let mut best = (Vec2::zeros(), f32::NEG_INFINITY);
    for _ in 0..DRAWS {
        let at = region.draw(stream);
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
    /// Where victims appear whose task has no area of its own.
    victims: Region,
    /// Where those of each other task appear.
    own: Vec<Option<Region>>,
    /// Solid cells of the map, if there is one.
    blocks: Option<Blocks>,
}

impl Placing {
    /// The measures of a valid scenario.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Self {
        let (arena, wall) = (scenario.arena_half_width_m as f32, scenario.wall_clearance_m as f32);
        let reach = arena - wall;
        let inside = |x: f64, y: f64| Vec2::new(x as f32, y as f32).map(|value| value.clamp(-reach, reach));
        let within =
            |[left, bottom, right, top]: [f64; 4]| Region::Area(inside(left, bottom), inside(right, top));
        let places = &scenario.victim_places_m;
        let victims = match scenario.victim_area_m {
            Some(corners) => within(corners),
            None if places.is_empty() => Region::square(reach),
            None => Region::OneOf(places.iter().map(|at| inside(at[0], at[1])).collect()),
        };
        let own = |task: &Task| {
            let held = places.iter().filter(|at| task.holds(at)).map(|at| inside(at[0], at[1]));
            task.area_m.map(
                |corners| if places.is_empty() { within(corners) } else { Region::OneOf(held.collect()) },
            )
        };
        Self {
            arena,
            spawn_clearance: scenario.spawn_clearance_m as f32,
            wall_clearance: wall,
            victims,
            own: scenario.tasks.iter().map(own).collect(),
            blocks: Blocks::of(scenario),
        }
    }

    /// How much more than `gap` a place is away from the map's solid cells, m: negative if it is less, and
    /// infinite if it is more.
    fn room(&self, at: Vec2, gap: f32) -> f32 {
        self.blocks.as_ref().map_or(f32::INFINITY, |blocks| blocks.distance(at, gap) - gap)
    }

    /// A place for an obstacle that blocks these layers (as bits), clear of those already `placed` and of robots
    /// of these layers that start at given places.
    pub fn obstacle(
        &self,
        stream: &mut Stream,
        solid: &Solid,
        blocked: u64,
        placed: &[Placed],
        starts: &[(&Body, Vec2)],
    ) -> Place {
        draw(stream, &Region::square((self.arena - solid.reach()).max(0.0)), |at| {
            let solids = placed.iter().map(|(other, centre)| other.distance(at - centre) - solid.reach());
            let gap = |(body, start): &(&Body, Vec2)| solid.distance(start - at) - body.radius - START_GAP_M;
            let starts = starts.iter().filter(|(body, _)| body.layer & blocked != 0);
            smallest(solids.chain(starts.map(gap))).min(self.room(at, solid.reach()))
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

    /// Whether a victim may be there: anywhere where one could appear, as callers may move it out of its area.
    #[must_use]
    pub fn may_be_victim(&self, at: Vec2) -> bool {
        at.amax() <= self.victim_reach()
    }

    /// A place for a robot, without overlap with solids and the `others` of its layer that are already placed:
    /// the one `given`, or a random one.
    pub fn robot(
        &self,
        stream: &mut Stream,
        body: &Body,
        given: Option<Vec2>,
        others: &[(&Body, Vec2)],
        solids: &[Placed],
    ) -> Place {
        let gap = body.radius + START_GAP_M;
        let clearance = |at: Vec2| {
            let others = others.iter().filter(|(other, _)| other.layer == body.layer);
            let others = others.map(|(other, centre)| (at - centre).norm() - other.radius - gap);
            let solids = solids.iter().map(|(solid, centre)| solid.distance(at - centre) - gap);
            let blocked = self.blocks.as_ref().is_some_and(|blocks| blocks.block(body.layer));
            smallest(others.chain(solids)).min(if blocked { self.room(at, gap) } else { f32::INFINITY })
        };
        match given {
            Some(at) => Place { at, clear: clearance(at) >= 0.0 },
            None => draw(stream, &Region::square(self.arena - gap), clearance),
        }
    }

    /// Whether victims of a task have an area of their own.
    #[must_use]
    pub fn has_area(&self, task: usize) -> bool {
        self.own[task].is_some()
    }

    /// A place for a victim of a task: away from walls and solids, and from every robot. One of a list is not
    /// taken by `others`; if all others of the list are too near to something, the one with the most room will
    /// do.
    pub fn victim(
        &self,
        stream: &mut Stream,
        task: usize,
        robots: &[Vec2],
        others: &(impl Iterator<Item = Vec2> + Clone),
        solids: &[Placed],
    ) -> Place {
        let region = self.own[task].as_ref().unwrap_or(&self.victims);
        let listed = matches!(region, Region::OneOf(_));
        let place = draw(stream, region, |at| {
            if listed && others.clone().any(|other| other == at) {
                return TAKEN;
            }
            let robots = robots.iter().map(|robot| (at - robot).norm() - self.spawn_clearance);
            let solids =
                solids.iter().map(|(solid, centre)| solid.distance(at - centre) - self.wall_clearance);
            smallest(robots.chain(solids)).min(self.room(at, self.wall_clearance))
        });
        Place { clear: place.clear || listed, ..place }
    }

    /// Whether one of these solids is too near for a victim to be there.
    #[must_use]
    pub fn is_blocked(&self, at: Vec2, solids: &[Placed]) -> bool {
        let near = |(solid, centre): &Placed| solid.distance(at - centre) < self.wall_clearance;
        solids.iter().any(near) || self.room(at, self.wall_clearance) < 0.0
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
            let centre = placing.obstacle(&mut stream, &solids[1], 1, &[(&solids[0], Vec2::zeros())], &[]);
            assert!(centre.clear && solids[0].distance(centre.at) >= solids[1].reach());
            let placed = [(&solids[0], Vec2::zeros()), (&solids[1], centre.at)];
            let mut robots: Vec<(&Body, Vec2)> = vec![];
            for body in &team {
                let place = placing.robot(&mut stream, body, None, &robots, &placed);
                assert!(place.clear && place.at.amax() + body.radius <= 1.0);
                assert!(robots.iter().all(|(other, at)| (at - place.at).norm() > other.radius + body.radius));
                assert!(placed.iter().all(|(solid, at)| solid.distance(place.at - at) > body.radius));
                robots.push((body, place.at));
            }
            let robots: Vec<Vec2> = robots.iter().map(|(_, at)| *at).collect();
            let victim = placing.victim(&mut stream, 0, &robots, &std::iter::empty(), &placed);
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
        let place = placing.victim(&mut stream, 0, &[Vec2::new(-0.9, -0.9)], &std::iter::empty(), &[]);
        assert!(!place.clear && place.at.x > 0.7 && place.at.y > 0.7, "{place:?}");
    }

    #[test]
    fn an_area_holds_all_victims_and_fills_up() {
        let scenario = Scenario { victim_area_m: Some([-0.5, 0.0, -0.1, 0.9]), ..Scenario::default() };
        let placing = Placing::new(&scenario);
        let mut stream = Stream::new(0, 0, 0, Purpose::Victims);
        let places: Vec<Vec2> =
            (0..500).map(|_| placing.victim(&mut stream, 0, &[], &std::iter::empty(), &[]).at).collect();
        assert!(places.iter().all(|at| (-0.5..=-0.1).contains(&at.x) && (0.0..=0.9).contains(&at.y)));
        assert!(places.iter().any(|at| at.x < -0.48) && places.iter().any(|at| at.x > -0.12));
        assert!(places.iter().any(|at| at.y < 0.05) && places.iter().any(|at| at.y > 0.85));
    }

    #[test]
    fn listed_places_are_all_used_and_never_shared() {
        let listed = [[0.5, 0.5], [-0.5, 0.25], [0.9, -0.9]];
        let scenario = Scenario { victim_places_m: listed.to_vec(), ..Scenario::default() };
        let placing = Placing::new(&scenario);
        let listed = listed.map(|[x, y]| Vec2::new(x as f32, y as f32));
        let mut stream = Stream::new(0, 0, 0, Purpose::Victims);
        let mut seen = [0; 3];
        for _ in 0..300 {
            let other = listed[1];
            let place = placing.victim(&mut stream, 0, &[], &[other].into_iter(), &[]);
            assert!(place.clear && place.at != other);
            let index = listed.iter().position(|at| *at == place.at);
            seen[index.unwrap_or_else(|| panic!("{place:?} is not listed"))] += 1;
        }
        assert!(seen[1] == 0 && seen[0] > 100 && seen[2] > 100, "{seen:?}");
        let near = placing.victim(&mut stream, 0, &listed, &std::iter::empty(), &[]);
        assert!(near.clear && listed.contains(&near.at), "{near:?}");
        let near = placing.victim(&mut stream, 0, &listed[1..], &[listed[0]].into_iter(), &[]);
        assert!(near.clear && listed[1..].contains(&near.at), "{near:?}");
        let disc = Solid::Disc(0.2);
        let blocked = |centre| listed.map(|at| placing.is_blocked(at, &[(&disc, centre)]));
        assert_eq!(blocked(Vec2::new(0.75, -0.9)), [false, false, true]);
        assert_eq!(blocked(Vec2::new(0.0, 0.0)), [false; 3]);
    }

    #[test]
    fn a_given_start_is_taken_as_it_is_and_draws_nothing() {
        let scenario = Scenario::default();
        let placing = Placing::new(&scenario);
        let team = bodies(&scenario);
        let mut stream = Stream::new(0, 0, 0, Purpose::Start);
        let at = Vec2::new(0.25, -0.5);
        let place = placing.robot(&mut stream, &team[0], Some(at), &[], &[]);
        assert!(place.clear && place.at == at && stream.words() == 0);
        let place = placing.robot(&mut stream, &team[1], Some(at), &[(&team[0], at)], &[]);
        assert!(!place.clear && place.at == at);
        let solid = Solid::Disc(0.3);
        for _ in 0..200 {
            let place = placing.obstacle(&mut stream, &solid, 1, &[], &[(&team[0], at)]);
            assert!(place.clear && (place.at - at).norm() > 0.35, "{place:?}");
        }
    }
}
