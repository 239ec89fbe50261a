//! Contacts of frictionless discs, walls and boxes, each at the instant it happens.
//!
//! Velocities change by contact alone, so everyone flies straight on until the first touch, whose time
//! is the root of a quadratic. There, all that touch and approach are stopped along their normals at
//! once, by the least impulses that do it: the inelastic law of Moreau, solved by Gauss-Seidel sweeps.
//! What rapier tends to as its substeps grow short is computed here without any.

use super::{Absent, Engine, Nobody, Shapes, Workspace, fly};
use crate::geometry::{Solid, Touch, Vec2};
use crate::robot::Body;
use crate::scenario::Scenario;

/// Things nearer than this touch, m: some ten units of rounding of a place in the arena, per metre.
const TOUCHING: f32 = 2e-6;
/// What approaches more slowly than this is left alone, m/s.
const STILL_MPS: f32 = 1e-5;
/// Sweeps over the contacts of one instant.
const MOST_SWEEPS: usize = 200;
/// Change of velocity in a sweep below which the impulses have settled, m/s.
const SETTLED_MPS: f32 = 1e-6;
/// Deepest overlap that a period may leave, as a share of the smaller of the two: less than the promised
/// 5 % by more than rounding.
const MOST_OVERLAP: f32 = 0.045;
/// Sweeps that push apart what rounding has left overlapping.
const SEPARATING_SWEEPS: usize = 8;

/// Two robots, or a robot and something that does not move, that touch now.
struct Contact {
    robot: usize,
    /// The other robot; none for a wall or an obstacle.
    other: Option<usize>,
    /// From the robot towards the other.
    normal: Vec2,
    /// Impulse so far, N s.
    impulse: f32,
}

#[derive(Default)]
pub(super) struct Scratch {
    contacts: Vec<Contact>,
    /// Where the robots were before the period, m.
    before: Vec<Vec2>,
}

pub(super) struct Discs {
    shapes: Shapes,
    /// 1 / mass, 1/kg.
    lightness: Vec<f32>,
    dt: f32,
    touch: Touch,
    /// Instants of contact in a period after which whoever still meets something waits for the next.
    most_instants: usize,
}

impl Discs {
    pub(super) fn new(scenario: &Scenario, team: &[Body], solids: &[Solid]) -> Self {
        Self {
            shapes: Shapes::new(scenario, team, solids),
            lightness: team.iter().map(|body| 1.0 / body.mass).collect(),
            dt: scenario.dt_s as f32,
            touch: Touch { slop: 0.0, parting: -STILL_MPS },
            most_instants: 8 + 4 * team.len(),
        }
    }

    /// All that touch now, whether they approach or not: what is pushed may be pushed into a third.
    fn find(&self, positions: &[Vec2], obstacles: &[Vec2], absent: impl Absent, contacts: &mut Vec<Contact>) {
        let near = TOUCHING * self.shapes.arena.max(1.0);
        contacts.clear();
        let mut add = |robot, other, normal| contacts.push(Contact { robot, other, normal, impulse: 0.0 });
        for (index, at) in positions.iter().enumerate().filter(|(index, _)| !absent.has(*index)) {
            let radius = self.shapes.radii[index];
            for axis in 0..2 {
                if at[axis].abs() + radius >= self.shapes.arena - near {
                    let mut normal = Vec2::zeros();
                    normal[axis] = at[axis].signum();
                    add(index, None, normal);
                }
            }
            for (other, place) in positions[..index].iter().enumerate() {
                if absent.has(other) {
                    continue;
                }
                let apart = place - at;
                let reach = radius + self.shapes.radii[other] + near;
                if apart.norm_squared() <= reach * reach {
                    add(index, Some(other), apart.try_normalize(0.0).unwrap_or_else(Vec2::x));
                }
            }
            self.shapes.each_solid(*at, radius + near, obstacles, |solid, centre| {
                let (depth, outward) = solid.nearest(at - centre);
                if depth <= radius + near {
                    add(index, None, -outward);
                }
            });
        }
    }

    /// Stops all approaches between what touches. Returns who was pushed, as bits.
    fn resolve(&self, contacts: &mut [Contact], velocities: &mut [Vec2]) -> u64 {
        for _ in 0..MOST_SWEEPS {
            let mut change = 0.0_f32;
            for contact in contacts.iter_mut() {
                let (robot, other) = (contact.robot, contact.other);
                let others = other.map_or(Vec2::zeros(), |other| velocities[other]);
                let give = self.lightness[robot] + other.map_or(0.0, |other| self.lightness[other]);
                let approach = contact.normal.dot(&(velocities[robot] - others));
                let impulse = (contact.impulse + approach / give).max(0.0);
                let added = impulse - contact.impulse;
                contact.impulse = impulse;
                velocities[robot] -= contact.normal * (added * self.lightness[robot]);
                if let Some(other) = other {
                    velocities[other] += contact.normal * (added * self.lightness[other]);
                }
                change = change.max(added.abs() * give);
            }
            if change < SETTLED_MPS {
                break;
            }
        }
        let pushed = contacts.iter().filter(|contact| contact.impulse > 0.0);
        pushed
            .fold(0, |bits, contact| bits | 1 << contact.robot | contact.other.map_or(0, |other| 1 << other))
    }

    /// Pushes apart what overlaps, the lighter farther; walls and obstacles give way to nobody.
    fn separate(&self, positions: &mut [Vec2], obstacles: &[Vec2], absent: impl Absent) {
        let present = |index: &usize| !absent.has(*index);
        for _ in 0..SEPARATING_SWEEPS {
            let mut overlapped = false;
            for index in (0..positions.len()).filter(present) {
                for other in (0..index).filter(present) {
                    let apart = positions[other] - positions[index];
                    let reach = self.shapes.radii[index] + self.shapes.radii[other];
                    if apart.norm_squared() >= reach * reach {
                        continue;
                    }
                    overlapped = true;
                    let distance = apart.norm();
                    let normal = apart.try_normalize(0.0).unwrap_or_else(Vec2::x);
                    let (own, others) = (self.lightness[index], self.lightness[other]);
                    let share = (reach - distance) / (own + others);
                    positions[index] -= normal * (share * own);
                    positions[other] += normal * (share * others);
                }
            }
            for (index, (at, radius)) in positions.iter_mut().zip(&self.shapes.radii).enumerate() {
                if absent.has(index) {
                    continue;
                }
                self.shapes.each_solid(*at, *radius, obstacles, |solid, centre| {
                    let (distance, outward) = solid.nearest(*at - centre);
                    if distance < *radius {
                        overlapped = true;
                        *at += outward * (radius - distance);
                    }
                });
                let limit = self.shapes.arena - radius;
                *at = at.map(|place| place.clamp(-limit, limit));
            }
            if !overlapped {
                break;
            }
        }
    }

    /// As [`Engine::advance`].
    fn period(
        &self,
        workspace: &mut Workspace,
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        obstacles: &[Vec2],
        absent: impl Absent,
    ) -> u64 {
        let Scratch { contacts, before } = &mut workspace.discs;
        before.clear();
        before.extend_from_slice(positions);
        let mut left = self.dt;
        let mut touched = 0;
        // Each instant past the limit stops somebody for good, so that as many more as there are robots
        // are enough. Numbers that are none might go on for ever.
        let bound = self.most_instants + positions.len();
        for instant in 0..=bound {
            let first = self.shapes.first_touch(self.touch, positions, velocities, obstacles, absent);
            if first >= left {
                break;
            }
            fly(positions, velocities, first);
            left -= first;
            self.find(positions, obstacles, absent, contacts);
            touched |= self.resolve(contacts, velocities);
            if instant == bound {
                velocities.fill(Vec2::zeros());
            } else if instant >= self.most_instants {
                // Whoever is in such a throng waits for the next period: it ends, and nobody overlaps.
                for contact in contacts.iter() {
                    velocities[contact.robot] = Vec2::zeros();
                    contact.other.into_iter().for_each(|other| velocities[other] = Vec2::zeros());
                }
            }
        }
        fly(positions, velocities, left);
        self.separate(positions, obstacles, absent);
        self.shapes.hold(MOST_OVERLAP, before, positions, velocities, obstacles, absent);
        touched
    }
}

impl Engine for Discs {
    fn advance(
        &self,
        workspace: &mut Workspace,
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        obstacles: &[Vec2],
        absent: u64,
    ) -> u64 {
        // Nearly always all are there. A type that says so takes the question out of every loop.
        if absent == 0 {
            self.period(workspace, positions, velocities, obstacles, Nobody)
        } else {
            self.period(workspace, positions, velocities, obstacles, absent)
        }
    }

    fn envs_worth_a_thread(&self) -> usize {
        64
    }
}
