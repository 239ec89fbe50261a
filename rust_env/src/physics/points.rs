//! No contacts: robots fly straight on through each other. Walls alone stop them.

use super::{Absent, Engine, Workspace, fly};
use crate::geometry::Vec2;
use crate::robot::Body;
use crate::scenario::Scenario;

pub(super) struct Points {
    /// How far from the centre of the arena each robot can be along an axis, m.
    limits: Vec<f32>,
    dt: f32,
}

impl Points {
    pub(super) fn new(scenario: &Scenario, team: &[Body]) -> Self {
        let arena = scenario.arena_half_width_m as f32;
        Self { limits: team.iter().map(|body| arena - body.radius).collect(), dt: scenario.dt_s as f32 }
    }
}

impl Engine for Points {
    fn advance(
        &self,
        _: &mut Workspace,
        positions: &mut [Vec2],
        velocities: &mut [Vec2],
        _: &[Vec2],
        absent: u64,
    ) -> u64 {
        fly(positions, velocities, self.dt);
        for (index, limit) in self.limits.iter().enumerate().filter(|(index, _)| !absent.has(*index)) {
            for axis in 0..2 {
                if positions[index][axis].abs() > *limit {
                    positions[index][axis] = limit.copysign(positions[index][axis]);
                    velocities[index][axis] = 0.0;
                }
            }
        }
        0
    }

    fn envs_worth_a_thread(&self) -> usize {
        64
    }
}
