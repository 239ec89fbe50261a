//! Range sensors: how near the first thing is along each ray from a robot's centre.
//!
//! Each thing within range is tried only on the rays that may meet it, which its direction and its width tell.

use std::cmp::Ordering;
use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_2, TAU};
use std::iter::zip;

use crate::blocks::Blocks;
use crate::geometry::{Solid, Vec2, direction};
use crate::robot::Body;
use crate::scenario::{MAX_RAYS, RangeSensor, Scenario};

/// What the directions of things are widened by, rad: far more than rounding moves them.
const MARGIN: f32 = 1e-3;

/// One robot's sensor.
#[derive(Debug, Clone)]
struct Sensor {
    /// The rays' directions, from straight ahead: unit vectors.
    directions: Vec<Vec2>,
    /// The angle of the first ray from straight ahead, rad.
    first: f32,
    /// How many rays there are in a rad.
    per_rad: f32,
    /// How far the rays reach, m.
    range: f32,
    /// The layers that they meet, as bits.
    layers: u64,
}

/// The range sensors of a scenario's team, and what does not move around it.
#[derive(Debug, Clone)]
pub struct Rays {
    /// By robot; none for one without rays.
    sensors: Vec<Option<Sensor>>,
    /// Most rays of a robot.
    most: usize,
    /// The obstacles' forms, and the layers that they block.
    solids: Vec<(Solid, u64)>,
    /// Solid cells of the map.
    blocks: Option<Blocks>,
    /// Half the side of the arena, m.
    half: f32,
}

/// What rays may meet at a moment.
#[derive(Debug, Clone, Copy)]
pub struct Around<'a> {
    /// The robots' constants.
    pub team: &'a [Body],
    /// Places of the robots, m.
    pub positions: &'a [Vec2],
    /// Places of the obstacles, m.
    pub obstacles: &'a [Vec2],
    /// Robots that have left the arena, as bits.
    pub absent: u64,
}

impl Rays {
    /// The range sensors of a valid scenario; `None` where no robot has any.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario, solids: &[Solid]) -> Option<Self> {
        let layers = scenario.layers();
        let sensor = |own: &str, sensor: &RangeSensor| {
            let met = layers.iter().enumerate().filter(|(_, layer)| sensor.meets(own, layer));
            let angles: Vec<f32> = sensor.angles().into_iter().map(|angle| angle as f32).collect();
            let directions = if sensor.is_all_around() {
                (0..sensor.rays).map(|ray| part_of_a_turn(ray, sensor.rays)).collect()
            } else {
                angles.iter().map(|angle| direction(*angle)).collect()
            };
            Sensor {
                directions,
                first: angles[0],
                per_rad: angles.get(1).map_or(1.0 / TAU, |second| 1.0 / (second - angles[0])),
                range: sensor.range_m as f32,
                layers: met.fold(0, |bits, (index, _)| bits | 1 << index),
            }
        };
        let most = scenario.max_rays();
        (most > 0).then(|| Self {
            sensors: scenario
                .robots
                .iter()
                .map(|robot| robot.range_sensor.as_ref().map(|one| sensor(&robot.layer, one)))
                .collect(),
            most,
            solids: zip(solids.iter().copied(), scenario.blocked()).collect(),
            blocks: Blocks::of(scenario),
            half: scenario.arena_half_width_m as f32,
        })
    }

    /// Columns of a robot's row: one for each ray of the robot that has most.
    #[must_use]
    pub fn width(&self) -> usize {
        self.most
    }

    /// Writes what robot `own`, which points along `ahead` (a unit vector), measures: for each ray
    /// 1 − distance / range, 0 where it meets nothing within its range, and 0 for rays that the robot lacks.
    pub fn read(&self, own: usize, ahead: Vec2, around: &Around, columns: &mut [f32]) {
        columns.fill(0.0);
        let Some(sensor) = &self.sensors[own] else { return };
        let from = around.positions[own];
        let mut directions = [Vec2::zeros(); MAX_RAYS];
        for (direction, own) in zip(&mut directions, &sensor.directions) {
            *direction = turned(*own, ahead);
        }
        let mut sweep = Sweep { sensor, ahead, directions, nearest: [sensor.range; MAX_RAYS] };
        sweep.meet_walls(from, self.half);
        for (other, (body, place)) in zip(around.team, around.positions).enumerate() {
            let there = other != own && around.absent >> other & 1 == 0;
            if there && body.layer & sensor.layers != 0 {
                sweep.meet(&Solid::Disc(body.radius), place - from);
            }
        }
        for ((solid, layers), place) in zip(&self.solids, around.obstacles) {
            if layers & sensor.layers != 0 {
                sweep.meet(solid, place - from);
            }
        }
        for blocks in self.blocks.iter().filter(|blocks| blocks.block(sensor.layers)) {
            blocks.near(from, sensor.range).for_each(|(solid, place)| sweep.meet(solid, place - from));
        }
        for (column, nearest) in zip(columns, &sweep.nearest[..sensor.directions.len()]) {
            *column = 1.0 - nearest / sensor.range;
        }
    }
}

/// The rays of one robot while they are followed.
struct Sweep<'a> {
    sensor: &'a Sensor,
    /// Where the robot points.
    ahead: Vec2,
    /// The rays' directions.
    directions: [Vec2; MAX_RAYS],
    /// The distance of the nearest thing met so far along each, the range if none, m.
    nearest: [f32; MAX_RAYS],
}

impl Sweep<'_> {
    /// Ends rays from a place at the walls of an arena of half width `half`, m.
    fn meet_walls(&mut self, from: Vec2, half: f32) {
        let rays = self.sensor.directions.len();
        if from.amax() + self.sensor.range < half {
            return;
        }
        for (direction, nearest) in zip(&self.directions, &mut self.nearest).take(rays) {
            for axis in 0..2 {
                let room = half - from[axis] * direction[axis].signum();
                let speed = direction[axis].abs();
                if room < *nearest * speed {
                    *nearest = (room / speed).max(0.0);
                }
            }
        }
    }

    /// Ends rays at a solid whose centre is `way` on from the robot's.
    fn meet(&mut self, solid: &Solid, way: Vec2) {
        let (reach, range) = (solid.reach(), self.sensor.range);
        let (squared, farthest) = (way.norm_squared(), reach + range);
        if squared >= farthest * farthest {
            return;
        }
        let rays = self.sensor.directions.len();
        if squared <= reach * reach {
            return self.try_rays(0, rays, solid, way);
        }
        let Sensor { first, per_rad, .. } = *self.sensor;
        // Half the angle that the disc around the solid takes up; an arc is at most π/2 times its sine.
        let half_angle = FRAC_PI_2 * reach / squared.sqrt() + MARGIN;
        let angle = libm::atan2f(self.ahead.perp(&way), self.ahead.dot(&way)) - first;
        for turn in [-TAU, 0.0, TAU] {
            // As numbers of rays; one too many costs less than to round them up and down.
            let [low, high] = [angle - half_angle, angle + half_angle].map(|edge| (edge + turn) * per_rad);
            if high >= 0.0 && low < rays as f32 {
                self.try_rays(low.max(0.0) as usize, (high as usize + 1).min(rays), solid, way);
            }
        }
    }

    /// Ends those of the rays numbered `begin..end` that meet a solid.
    fn try_rays(&mut self, begin: usize, end: usize, solid: &Solid, way: Vec2) {
        for ray in begin..end {
            let met = solid.met_after(way, self.directions[ray]);
            self.nearest[ray] = self.nearest[ray].min(met);
        }
    }
}

/// The direction after `ray` of `rays` equal parts of a turn. Quarter turns and mirrors of it are exact.
fn part_of_a_turn(ray: usize, rays: usize) -> Vec2 {
    let (quarter, rest) = (4 * ray / rays, 4 * ray % rays);
    let within = |rest: usize| direction(FRAC_PI_2 * rest as f32 / rays as f32);
    let first = match (2 * rest).cmp(&rays) {
        Ordering::Less => within(rest),
        Ordering::Equal => Vec2::repeat(FRAC_1_SQRT_2),
        Ordering::Greater => within(rays - rest).yx(),
    };
    let (x, y) = (first.x, first.y);
    match quarter {
        0 => Vec2::new(x, y),
        1 => Vec2::new(-y, x),
        2 => Vec2::new(-x, -y),
        _ => Vec2::new(y, -x),
    }
}

/// A direction from straight ahead as one from the x axis.
fn turned(direction: Vec2, ahead: Vec2) -> Vec2 {
    ahead * direction.x + Vec2::new(-ahead.y, ahead.x) * direction.y
}
