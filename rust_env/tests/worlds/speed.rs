//! Speed caps bind and hold, and whoever touches nothing moves as the equation of motion says.

use std::iter::zip;

use innerattn_env::geometry::Vec2;
use innerattn_env::scenario::{Actions, Scenario};
use innerattn_env::world::World;

use crate::common::{ENGINES, Table, chance, mixed_team, options, random_drive, some_obstacles};

const ENVS: usize = 64;

#[test]
fn every_kind_reaches_its_cap_in_the_world() {
    let scenario = Scenario { arena_half_width_m: 5.0, ..Scenario::default() };
    let caps: Vec<f64> = scenario.robots.iter().map(|robot| robot.max_speed_mps).collect();
    let mut table = Table::new(scenario, options(1, 0));
    // Side by side on their way to the right, far apart.
    let places: Vec<f32> = [[-3.0, 3.0], [-3.0, 1.0], [-3.0, -1.0], [-3.0, -3.0]].concat();
    table.batch.set_motion(&places, &[0.0; 8]).expect("a valid state");
    for _ in 0..15 {
        table.step(&[[1.0, 0.0]; 4]);
    }
    let world = table.batch.worlds().next().expect("one world");
    for (velocity, cap) in world.velocities.iter().zip(caps) {
        assert!((f64::from(velocity.norm()) - cap).abs() < 1e-6, "{velocity} for a cap of {cap}");
    }
}

/// Least distance from a robot's edge to anything else on the way from one state to the next, m.
fn room(table: &Table, before: &World, after: &World, robot: usize) -> f32 {
    let rules = table.batch.rules();
    let radius = rules.team[robot].radius;
    let room_at = |share: f32| {
        let place = |robot: usize| before.positions[robot].lerp(&after.positions[robot], share);
        let at = place(robot);
        let wall = rules.scenario.arena_half_width_m as f32 - at.amax();
        let others = (0..rules.team.len()).filter(|other| *other != robot);
        let others = others.map(|other| (at - place(other)).norm() - rules.team[other].radius);
        let solids = zip(&rules.solids, &before.obstacles);
        let solids = solids.map(|(solid, centre)| solid.distance(at - centre));
        others.chain(solids).fold(wall, f32::min) - radius
    };
    (0..=20).map(|part| room_at(part as f32 / 20.0)).fold(f32::INFINITY, f32::min)
}

#[test]
fn caps_hold_and_what_touches_nothing_flies_as_it_should() {
    let slow = Scenario { contact_cost: 1.0, actions: Actions::Continuous, ..Scenario::default() };
    let crowd = Scenario { robots: mixed_team(12), spawn_clearance_m: 0.1, ..slow.clone() };
    let blocked = Scenario { obstacles: some_obstacles(), substeps: 4, damping: 0.1, ..slow.clone() };
    for (scenario, engine) in [slow, crowd, blocked].iter().flat_map(|s| ENGINES.map(|engine| (s, engine))) {
        let scenario = Scenario { engine, ..scenario.clone() };
        let (dt, keep) = (scenario.dt_s as f32, 1.0 - scenario.damping as f32);
        let mut table = Table::new(scenario, options(ENVS, 2));
        let team = table.batch.rules().team.clone();
        let mut chance = chance(6);
        let (mut free, mut touched, mut capped) = (0_u32, 0_u32, 0_u32);
        let mut drives: Vec<[f32; 2]> = vec![[0.0; 2]; ENVS * team.len()];
        for step in 0..400 {
            for drive in &mut drives {
                // Held for some steps, so that speeds grow.
                if chance.below(5) == 0 {
                    let [x, y] = random_drive(&mut chance);
                    *drive = if step % 2 == 0 { [x, y] } else { [0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y] };
                }
            }
            let before: Vec<_> = table.batch.worlds().cloned().collect();
            table.step(&drives);
            for (env, (world, before)) in table.batch.worlds().zip(&before).enumerate() {
                if world.episode != before.episode {
                    continue;
                }
                for (robot, body) in team.iter().enumerate() {
                    let row = env * team.len() + robot;
                    if table.touched(row) {
                        touched += 1;
                        continue;
                    }
                    let wanted = before.velocities[robot] * keep + Vec2::from(drives[row]) * body.gain;
                    let share = (body.max_speed / wanted.norm().max(1e-9)).min(1.0);
                    let moved = world.positions[robot] - before.positions[robot];
                    // Near others the engine is at work: it may set one right by a hair without a push.
                    let clear = room(&table, before, world, robot) > 0.12;
                    let slack = if clear { 1e-6 } else { 1e-3 };
                    assert!(moved.norm() <= body.max_speed * dt * (1.0 + 1e-6) + slack, "{moved}");
                    assert!((moved - wanted * share * dt).norm() <= slack, "{moved} {wanted}");
                    assert!((world.velocities[robot] - wanted * share).norm() < 2e-6);
                    free += u32::from(clear);
                    capped += u32::from(share < 1.0);
                }
            }
        }
        assert!(free > 20_000 && capped > 5_000 && touched > 5_000, "{free} {capped} {touched}");
    }
}
