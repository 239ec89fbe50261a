//! Contacts by rapier's rigid bodies, in substeps. The only file that names rapier.
//!
//! Velocities change by contact alone, so whatever can touch nothing flies straight on, exactly, and
//! rapier runs only in substeps in which something would touch. It starts each period in a copy of one
//! prepared world: none of its caches survives.

use rapier2d::prelude::{
    BroadPhaseBvh, CCDSolver, Collider, ColliderBuilder, ColliderHandle, ColliderSet, ImpulseJointSet,
    IntegrationParameters, IslandManager, MultibodyJointSet, NarrowPhase, PhysicsPipeline, Pose,
    RigidBodyBuilder, RigidBodyHandle, RigidBodySet, SharedShape, SoftBodySet, Vector,
};

use super::{Absent, Engine, Shapes, Workspace, fly};
use crate::blocks::Blocks;
use crate::geometry::{Solid, Touch, Vec2};
use crate::robot::Body;
use crate::scenario::Scenario;

/// How far ahead contacts are prepared, as a share of what the fastest pair closes in a substep.
const PREDICTION: f64 = 1.4;
/// Deepest overlap with a wall that the engine is left to mend, as a share of the radius.
const MOST_IN_WALL: f32 = 0.04;
/// Deepest other overlap that a substep may leave, as a share of the smaller of the two: less than the
/// promised 15 % by more than rounding.
const MOST_OVERLAP: f32 = 0.14;
/// Solver iterations of a substep: at least this many, and two for each robot of a small team, which
/// bounds how long a chain of contacts is, and for each weight of the lightest in the heaviest. With 4
/// a crowd of 16 unlike robots is left 15 % of a radius deep in each other.
const LEAST_ITERATIONS: usize = 8;
const MOST_FOR_ROBOTS: usize = 16;
/// An overlap below the slop is left alone: it is small beside any radius, large beside rounding.
/// What overlaps more is mended, unless it parts at some speed by itself.
const TOUCH: Touch = Touch { slop: 5e-5, parting: 1e-2 };
/// Contact stiffness for each solver iteration, Hz: as stiff as an iteration's short time allows.
const STIFFNESS_HZ: f32 = 15.0;

/// A world of the engine, whole: what a period starts from is a copy of it.
#[derive(Clone)]
struct EngineWorld {
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
}

/// rapier's scratch memory.
pub(super) struct Scratch {
    pipeline: PhysicsPipeline,
    joints: ImpulseJointSet,
    multibodies: MultibodyJointSet,
    soft_bodies: SoftBodySet,
    ccd: CCDSolver,
    /// Where the robots were before a substep, m.
    before: Vec<Vec2>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            pipeline: PhysicsPipeline::new(),
            joints: ImpulseJointSet::new(),
            multibodies: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            ccd: CCDSolver::new(),
            before: vec![],
        }
    }
}

/// A scenario's motion, prepared.
pub(super) struct Rapier {
    prepared: EngineWorld,
    robots: Vec<RigidBodyHandle>,
    obstacles: Vec<ColliderHandle>,
    parameters: IntegrationParameters,
    shapes: Shapes,
    dt: f32,
    substeps: u32,
}

impl Rapier {
    pub(super) fn new(scenario: &Scenario, team: &[Body], solids: &[Solid]) -> Self {
        let friction = scenario.friction as f32;
        let arena = scenario.arena_half_width_m as f32;
        let mut world = EngineWorld {
            islands: IslandManager::new(),
            broad_phase: BroadPhaseBvh::new(),
            narrow_phase: NarrowPhase::new(),
            bodies: RigidBodySet::new(),
            colliders: ColliderSet::new(),
        };
        let mut robots = Vec::with_capacity(team.len());
        let mut parked = 4.0 * arena;
        for (index, body) in team.iter().enumerate() {
            parked += 4.0 * body.radius;
            let rigid = RigidBodyBuilder::dynamic()
                .translation(Vector::new(parked, 0.0))
                .lock_rotations()
                .can_sleep(false)
                .gravity_scale(0.0);
            let handle = world.bodies.insert(rigid);
            let disc =
                ColliderBuilder::ball(body.radius).mass(body.mass).friction(friction).user_data(1 << index);
            world.colliders.insert_with_parent(disc, handle, &mut world.bodies);
            robots.push(handle);
        }
        let obstacles =
            solids.iter().map(|solid| world.colliders.insert(collider(solid, friction))).collect();
        let shapes = Shapes::new(scenario, team, solids);
        // One collider for the whole map: a copy of the world shares its shape.
        let blocks = shapes.blocks.iter().flat_map(Blocks::all);
        let parts: Vec<_> = blocks
            .map(|(solid, at)| (Pose::from_translation(Vector::new(at.x, at.y)), shape(solid)))
            .collect();
        if !parts.is_empty() {
            let map = ColliderBuilder::new(SharedShape::compound(parts)).friction(friction);
            world.colliders.insert(map);
        }
        for (side, half) in walls(arena) {
            let wall = ColliderBuilder::cuboid(half.x, half.y).friction(friction);
            world.colliders.insert(wall.translation(Vector::new(side.x, side.y)));
        }
        let parameters = quality(scenario);
        let still = IntegrationParameters { dt: 0.0, ..parameters };
        Scratch::default().step(&mut world, &still);
        Self {
            prepared: world,
            robots,
            obstacles,
            parameters,
            shapes,
            dt: scenario.dt_s as f32,
            substeps: scenario.substeps,
        }
    }

    /// Puts whoever was squeezed too deep into a wall back to near its edge: walls give way to no weight.
    fn keep_inside(&self, positions: &mut [Vec2], velocities: &mut [Vec2]) {
        for (index, (at, velocity)) in positions.iter_mut().zip(velocities).enumerate() {
            let limit = self.shapes.arena - (1.0 - MOST_IN_WALL) * self.shapes.radii[index];
            for axis in 0..2 {
                if at[axis].abs() > limit {
                    at[axis] = at[axis].clamp(-limit, limit);
                    velocity[axis] = 0.0;
                }
            }
        }
    }

    /// A fresh copy of the prepared world with the obstacles in their places.
    fn start(&self, obstacles: &[Vec2]) -> EngineWorld {
        let mut world = self.prepared.clone();
        for (handle, centre) in self.obstacles.iter().zip(obstacles) {
            world.colliders[*handle].set_translation(Vector::new(centre.x, centre.y));
        }
        world
    }

    /// Puts all but those `absent` into their places: these stay where the prepared world has them, apart.
    fn place(&self, world: &mut EngineWorld, positions: &[Vec2], velocities: &[Vec2], absent: u64) {
        let moving = self.robots.iter().zip(positions.iter().zip(velocities)).enumerate();
        for (_, (handle, (at, velocity))) in moving.filter(|(index, _)| !absent.has(*index)) {
            let body = &mut world.bodies[*handle];
            body.set_translation(Vector::new(at.x, at.y), false);
            body.set_linvel(Vector::new(velocity.x, velocity.y), false);
        }
    }

    /// Takes over the engine's motion of whoever it prepared a contact for, and whether one was pushed.
    /// All others fly straight on, free of the engine's rounding.
    fn read(&self, world: &EngineWorld, positions: &mut [Vec2], velocities: &mut [Vec2]) -> u64 {
        let (mut near, mut pushed) = (0_u64, 0_u64);
        for pair in world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact()) {
            let bits = world.colliders[pair.collider1].user_data | world.colliders[pair.collider2].user_data;
            near |= bits as u64;
            pushed |= if pair.total_impulse_magnitude() > 0.0 { bits as u64 } else { 0 };
        }
        for (index, (at, velocity)) in positions.iter_mut().zip(velocities).enumerate() {
            if near >> index & 1 == 0 {
                *at += *velocity * self.parameters.dt;
                continue;
            }
            let body = &world.bodies[self.robots[index]];
            let (place, speed) = (body.translation(), body.linvel());
            *at = Vec2::new(place.x, place.y);
            *velocity = Vec2::new(speed.x, speed.y);
        }
        pushed
    }
}

impl Engine for Rapier {
    fn advance(
        &self,
        workspace: &mut Workspace,
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        obstacles: &[Vec2],
        absent: u64,
    ) -> u64 {
        let substep = self.parameters.dt;
        let mut contact: Option<EngineWorld> = None;
        let mut touched = 0;
        let mut done = 0;
        while done < self.substeps {
            let left = self.substeps - done;
            let horizon = if done == 0 { self.dt } else { left as f32 * substep };
            let first = self.shapes.first_touch(TOUCH, positions, velocities, obstacles, absent);
            if first >= horizon {
                fly(positions, velocities, horizon);
                break;
            }
            let free = ((first / substep) as u32).min(left - 1);
            fly(positions, velocities, free as f32 * substep);
            let world = contact.get_or_insert_with(|| self.start(obstacles));
            self.place(world, positions, velocities, absent);
            let scratch = &mut workspace.rapier;
            scratch.step(world, &self.parameters);
            scratch.before.clear();
            scratch.before.extend_from_slice(positions);
            touched |= self.read(world, positions, velocities);
            self.keep_inside(positions, velocities);
            self.shapes.hold(MOST_OVERLAP, &scratch.before, positions, velocities, obstacles, absent);
            done += free + 1;
        }
        touched
    }

    fn envs_worth_a_thread(&self) -> usize {
        8
    }
}

impl Scratch {
    fn step(&mut self, world: &mut EngineWorld, parameters: &IntegrationParameters) {
        self.pipeline.step(
            Vector::ZERO,
            parameters,
            &mut world.islands,
            &mut world.broad_phase,
            &mut world.narrow_phase,
            &mut world.bodies,
            &mut world.colliders,
            &mut self.joints,
            &mut self.multibodies,
            &mut self.soft_bodies,
            &mut self.ccd,
            &(),
            &(),
        );
    }
}

fn collider(solid: &Solid, friction: f32) -> Collider {
    ColliderBuilder::new(shape(solid)).friction(friction).build()
}

fn shape(solid: &Solid) -> SharedShape {
    match solid {
        Solid::Disc(radius) => SharedShape::ball(*radius),
        Solid::Box(half) => SharedShape::cuboid(half.x, half.y),
    }
}

/// Centres and half extents of the four walls, each as thick as the arena is wide.
fn walls(arena: f32) -> [(Vec2, Vec2); 4] {
    let long = 3.0 * arena;
    let along_y = Vec2::new(arena, long);
    let along_x = Vec2::new(long, arena);
    [
        (Vec2::new(2.0 * arena, 0.0), along_y),
        (Vec2::new(-2.0 * arena, 0.0), along_y),
        (Vec2::new(0.0, 2.0 * arena), along_x),
        (Vec2::new(0.0, -2.0 * arena), along_x),
    ]
}

/// The contact quality: robots of 5 cm at 1.5 m/s are far from the engine's own defaults, under which
/// they pass through each other. A contact must be seen before it is passed, and be stiff enough to
/// end the approach within the period.
fn quality(scenario: &Scenario) -> IntegrationParameters {
    let substep = scenario.dt_s / f64::from(scenario.substeps);
    let fastest = scenario.robots.iter().map(|robot| robot.max_speed_mps).fold(0.0, f64::max);
    let for_robots = (2 * scenario.robots.len()).min(MOST_FOR_ROBOTS);
    let for_masses = (2.0 * scenario.mass_ratio()) as usize;
    let iterations = LEAST_ITERATIONS.max(for_robots).max(for_masses);
    let mut parameters = IntegrationParameters {
        dt: substep as f32,
        normalized_prediction_distance: (PREDICTION * 2.0 * fastest * substep) as f32,
        num_solver_iterations: iterations,
        num_internal_pgs_iterations: 2,
        num_internal_stabilization_iterations: 2,
        max_ccd_substeps: 0,
        contact_recycling: false,
        ..IntegrationParameters::default()
    };
    let stiffness = STIFFNESS_HZ * iterations as f32;
    parameters.contact_softness.natural_frequency = stiffness;
    parameters.static_contact_softness.natural_frequency = 2.0 * stiffness;
    parameters
}
