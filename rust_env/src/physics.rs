//! Motion and contacts during one control period, by one of three engines; nothing else in the crate
//! knows which one runs. Each starts from positions and velocities alone and keeps nothing: a world's
//! future depends on its own state only.

mod discs;
mod points;
mod rapier;

use crate::blocks::Blocks;
use crate::geometry::{Solid, Touch, Vec2};
use crate::robot::{Body, bodies};
use crate::scenario::{Engine as Choice, Scenario};

/// What moves robots through a control period.
trait Engine: Send + Sync {
    /// Moves the robots through one control period, in place. `obstacles` are the solids' centres; robots that
    /// are `absent` (as bits) touch nothing and have no velocity. Returns which robots were pushed by a contact,
    /// as bits.
    fn advance(
        &self,
        workspace: &mut Workspace,
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        obstacles: &[Vec2],
        absent: u64,
    ) -> u64;

    /// Worlds whose steps take long enough to be worth another thread.
    fn envs_worth_a_thread(&self) -> usize;
}

/// The engines' scratch memory; one for each part of a batch, and nothing in it outlives a period.
#[derive(Default)]
pub struct Workspace {
    rapier: rapier::Scratch,
    discs: discs::Scratch,
    layer: LayerScratch,
}

/// The robots and obstacles of one layer.
#[derive(Default)]
struct LayerScratch {
    positions: Vec<Vec2>,
    velocities: Vec<Vec2>,
    obstacles: Vec<Vec2>,
}

/// Robots that can touch each other, and what moves them.
struct Layer {
    /// Indices of the robots.
    robots: Vec<usize>,
    /// Indices of the obstacles that block them.
    obstacles: Vec<usize>,
    engine: Box<dyn Engine>,
}

impl Layer {
    fn new(scenario: &Scenario, name: &str) -> Self {
        let robots = scenario.robots.iter().enumerate().filter(|(_, robot)| robot.layer == name);
        let obstacles = scenario.obstacles.iter().enumerate().filter(|(_, obstacle)| obstacle.blocks(name));
        let alone = scenario.layer_alone(name);
        let team = bodies(&alone);
        let solids: Vec<Solid> = alone.obstacles.iter().map(Solid::of).collect();
        Self {
            robots: robots.map(|(index, _)| index).collect(),
            obstacles: obstacles.map(|(index, _)| index).collect(),
            engine: match scenario.engine {
                Choice::Rapier => Box::new(rapier::Rapier::new(&alone, &team, &solids)),
                Choice::Discs => Box::new(discs::Discs::new(&alone, &team, &solids)),
                Choice::None => Box::new(points::Points::new(&alone, &team)),
            },
        }
    }

    /// As [`Physics::advance`], for the robots of this layer alone.
    fn advance(
        &self,
        workspace: &mut Workspace,
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        obstacles: &[Vec2],
        absent: u64,
    ) -> u64 {
        let mut own = std::mem::take(&mut workspace.layer);
        let LayerScratch { positions: places, velocities: speeds, obstacles: centres } = &mut own;
        let some = |into: &mut Vec<Vec2>, of: &[Vec2], which: &[usize]| {
            into.clear();
            into.extend(which.iter().map(|index| of[*index]));
        };
        some(places, positions, &self.robots);
        some(speeds, velocities, &self.robots);
        some(centres, obstacles, &self.obstacles);
        let number = self.robots.iter().enumerate();
        let away = number.clone().fold(0, |bits, (own, index)| bits | (absent >> index & 1) << own);
        let touched = self.engine.advance(workspace, places, speeds, centres, away);
        for (own, index) in number.clone() {
            (positions[*index], velocities[*index]) = (places[own], speeds[own]);
        }
        workspace.layer = own;
        number.fold(0, |bits, (own, index)| bits | (touched >> own & 1) << index)
    }
}

/// Everything about motion that a scenario fixes: each layer by itself, so that none changes another.
pub struct Physics(Vec<Layer>);

impl Physics {
    /// Prepares the motion of a valid scenario's team.
    #[must_use]
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self(scenario.layers().iter().map(|name| Layer::new(scenario, name)).collect())
    }

    /// Moves the robots through one control period, in place. `obstacles` are the solids' centres; robots that
    /// are `absent` (as bits) touch nothing and have no velocity. Returns which robots were pushed by a contact,
    /// as bits.
    pub fn advance(
        &self,
        workspace: &mut Workspace,
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        obstacles: &[Vec2],
        absent: u64,
    ) -> u64 {
        if let [only] = &self.0[..] {
            return only.engine.advance(workspace, positions, velocities, obstacles, absent);
        }
        let each = self.0.iter();
        each.fold(0, |bits, one| bits | one.advance(workspace, positions, velocities, obstacles, absent))
    }

    /// Worlds whose steps take long enough to be worth another thread.
    #[must_use]
    pub fn envs_worth_a_thread(&self) -> usize {
        self.0[0].engine.envs_worth_a_thread()
    }
}

/// The robots, walls and obstacles that can touch each other.
struct Shapes {
    /// Of the robots, m.
    radii: Vec<f32>,
    solids: Vec<Solid>,
    /// Solid cells of the map, if they block these robots.
    blocks: Option<Blocks>,
    /// Half the side of the arena, m.
    arena: f32,
    /// Control period, s.
    dt: f32,
}

impl Shapes {
    fn new(scenario: &Scenario, team: &[Body], solids: &[Solid]) -> Self {
        Self {
            radii: team.iter().map(|body| body.radius).collect(),
            solids: solids.to_vec(),
            blocks: Blocks::of(scenario),
            arena: scenario.arena_half_width_m as f32,
            dt: scenario.dt_s as f32,
        }
    }

    /// Visits the obstacles, and those of the map's boxes that may be within `reach` of a place, with their
    /// centres.
    #[inline]
    fn each_solid(&self, at: Vec2, reach: f32, obstacles: &[Vec2], mut visit: impl FnMut(&Solid, Vec2)) {
        for (solid, centre) in self.solids.iter().zip(obstacles) {
            visit(solid, *centre);
        }
        if let Some(blocks) = &self.blocks {
            each_block(blocks, at, reach, &mut visit);
        }
    }

    /// Time until anything would touch if all moved straight on, s; infinite if nothing would in a control
    /// period.
    fn first_touch(
        &self,
        touch: Touch,
        positions: &[Vec2],
        velocities: &[Vec2],
        obstacles: &[Vec2],
        absent: impl Absent,
    ) -> f32 {
        let mut first = f32::INFINITY;
        for (index, (at, velocity)) in positions.iter().zip(velocities).enumerate() {
            if absent.has(index) {
                continue;
            }
            let radius = self.radii[index];
            first = first.min(touch.walls(at.x, velocity.x, self.arena - radius));
            first = first.min(touch.walls(at.y, velocity.y, self.arena - radius));
            for other in (0..index).filter(|other| !absent.has(*other)) {
                let reach = radius + self.radii[other];
                first = first.min(touch.discs(positions[other] - at, velocities[other] - velocity, reach));
            }
            for (solid, centre) in self.solids.iter().zip(obstacles) {
                first = first.min(touch.solid(solid, at - centre, *velocity, radius));
            }
            if let Some(blocks) = &self.blocks {
                first = first.min(self.first_block(blocks, touch, *at, *velocity, radius));
            }
        }
        first
    }

    /// Time until a robot would touch a box of the map, as [`Self::first_touch`].
    #[inline(never)] // worlds without a map are faster without it
    fn first_block(&self, blocks: &Blocks, touch: Touch, at: Vec2, velocity: Vec2, radius: f32) -> f32 {
        let near = blocks.near(at, radius + velocity.norm() * self.dt);
        near.map(|(solid, centre)| touch.solid(solid, at - centre, velocity, radius))
            .fold(f32::INFINITY, f32::min)
    }

    /// Puts whoever overlaps something by more than `most` of the smaller of the two back to where it was
    /// `before`, and stops it there, until nobody does. Nothing overlapped more deeply before, so this holds.
    fn hold(
        &self,
        most: f32,
        before: &[Vec2],
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        obstacles: &[Vec2],
        absent: impl Absent,
    ) {
        let mut held = absent.bits();
        loop {
            let sunk = self.sunk(most, positions, obstacles, absent) & !held;
            if sunk == 0 {
                return;
            }
            held |= sunk;
            for index in (0..positions.len()).filter(|index| sunk >> index & 1 == 1) {
                positions[index] = before[index];
                velocities[index] = Vec2::zeros();
            }
        }
    }

    /// The robots that overlap another robot or an obstacle by more than `most` of the smaller of the two,
    /// as bits.
    fn sunk(&self, most: f32, positions: &[Vec2], obstacles: &[Vec2], absent: impl Absent) -> u64 {
        let mut sunk = 0_u64;
        for (index, at) in positions.iter().enumerate().filter(|(index, _)| !absent.has(*index)) {
            let radius = self.radii[index];
            for (other, place) in positions[..index].iter().enumerate() {
                if absent.has(other) {
                    continue;
                }
                let reach = radius + self.radii[other] - most * radius.min(self.radii[other]);
                if (place - at).norm_squared() < reach * reach {
                    sunk |= 1 << index | 1 << other;
                }
            }
            for (solid, centre) in self.solids.iter().zip(obstacles) {
                if solid.is_sunk_in(at - centre, radius, most) {
                    sunk |= 1 << index;
                }
            }
            if let Some(blocks) = &self.blocks {
                sunk |= u64::from(is_in_block(blocks, *at, radius, most)) << index;
            }
        }
        sunk
    }
}

/// Visits the boxes of a map that may be within `reach` of a place, with their centres.
#[inline(never)] // worlds without a map are faster without it
fn each_block(blocks: &Blocks, at: Vec2, reach: f32, visit: &mut dyn FnMut(&Solid, Vec2)) {
    blocks.near(at, reach).for_each(|(solid, centre)| visit(solid, centre));
}

/// Whether a robot overlaps a box of the map, as [`Shapes::sunk`] says.
#[inline(never)] // worlds without a map are faster without it
fn is_in_block(blocks: &Blocks, at: Vec2, radius: f32, most: f32) -> bool {
    blocks.near(at, radius).any(|(solid, centre)| solid.is_sunk_in(at - centre, radius, most))
}

/// Which robots are absent.
trait Absent: Copy {
    /// As bits.
    fn bits(self) -> u64;

    /// Whether a robot is one of them.
    fn has(self, robot: usize) -> bool {
        self.bits() >> robot & 1 == 1
    }
}

impl Absent for u64 {
    fn bits(self) -> u64 {
        self
    }
}

/// No robot is absent.
#[derive(Clone, Copy)]
struct Nobody;

impl Absent for Nobody {
    fn bits(self) -> u64 {
        0
    }
}

/// Moves all straight on for `time`, s.
fn fly(positions: &mut [Vec2], velocities: &[Vec2], time: f32) {
    for (at, velocity) in positions.iter_mut().zip(velocities) {
        *at += velocity * time;
    }
}
