//! Robots that leave the arena while they are not available, and come back.

use std::iter::zip;

use innerattn_env::fault::{Fault, HEALTHY, Kind};
use innerattn_env::geometry::Vec2;
use innerattn_env::scenario::{Engine, Robot, Scenario, Unavailable};
use innerattn_env::world::World;
use proptest::prelude::*;

use crate::common::{ENGINES, Table, chance, fault, mixed_team, options, random_drive};

const ENVS: usize = 4;
const ROBOTS: usize = 5;
const STEPS: usize = 80;

/// A tight arena whose robots leave and come back at random.
fn scenario(engine: Engine) -> Scenario {
    let robots = mixed_team(ROBOTS);
    let leaves = |robot: &Robot| Fault {
        onset_rate_hz: Some(1.0),
        duration_steps: Some(6),
        ..fault(&robot.name, Kind::Unavailable, 1.0)
    };
    Scenario {
        faults: robots.iter().map(leaves).collect(),
        robots,
        engine,
        unavailable_robots: Unavailable::Leave,
        arena_half_width_m: 0.5,
        spawn_clearance_m: 0.05,
        episode_steps: 30,
        contact_cost: 1.0,
        ..Scenario::default()
    }
}

/// The robots that are in the arena, with their places and radii.
fn present(scenario: &Scenario, world: &World, absent: u64) -> Vec<(usize, Vec2, f32)> {
    let radius = |robot: usize| scenario.robots[robot].radius_m as f32;
    let there = (0..ROBOTS).filter(|robot| absent >> robot & 1 == 0);
    there.map(|robot| (robot, world.positions[robot], radius(robot))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Who has left stands still, touches nobody, is not seen and sees nothing. Who is there overlaps nobody,
    /// and who comes back is clear of all others.
    #[test]
    fn who_has_left_is_not_there(seed in 0..10_000_u64, engine in 0..2_usize) {
        let scenario = scenario(ENGINES[engine]);
        let (mut table, mut chance) = (Table::new(scenario.clone(), options(ENVS, seed)), chance(seed));
        let (width, mut left, mut came_back) = (table.batch.rules().layout.width(), 0, 0);
        let block = table.batch.rules().layout.names().iter().filter(|name| name.starts_with("own.")).count();
        let mut before = [0; ENVS];
        for _ in 0..STEPS {
            let drives: Vec<[f32; 2]> = (0..ENVS * ROBOTS).map(|_| random_drive(&mut chance)).collect();
            table.step(&drives);
            for (env, world) in table.batch.worlds().enumerate() {
                let absent = world.absent(table.batch.rules());
                left += absent.count_ones();
                let there = present(&scenario, world, absent);
                for (number, (robot, at, radius)) in there.iter().enumerate() {
                    prop_assert!(at.amax() <= 0.5 - 0.95 * radius);
                    for (_, other, others) in &there[..number] {
                        let overlap = radius + others - (at - other).norm();
                        prop_assert!(overlap <= 0.15 * radius.min(*others));
                    }
                    let is_new = table.terminated[env] || table.truncated[env];
                    if before[env] >> robot & 1 == 1 && !is_new {
                        came_back += 1;
                        prop_assert!(world.velocities[*robot] == Vec2::zeros());
                        let others = there.iter().filter(|(other, ..)| other != robot);
                        for (_, other, others) in others {
                            prop_assert!((at - other).norm() > radius + others);
                        }
                    }
                }
                let rows = table.obs[env * ROBOTS * width..][..ROBOTS * width].chunks_exact(width);
                for (own, row) in rows.enumerate() {
                    let others = (0..ROBOTS).filter(|other| *other != own);
                    let order = std::iter::once(own).chain(others);
                    for (robot, block) in zip(order, row.chunks_exact(block)) {
                        let is_gone = absent >> robot & 1 == 1 || absent >> own & 1 == 1;
                        prop_assert!(is_gone == block.iter().all(|number| *number == 0.0));
                    }
                    if absent >> own & 1 == 1 {
                        prop_assert!(world.velocities[own] == Vec2::zeros());
                        prop_assert!(row.iter().all(|number| *number == 0.0));
                    }
                }
                for robot in (0..ROBOTS).filter(|robot| (before[env] & absent) >> robot & 1 == 1) {
                    prop_assert!(!table.touched(env * ROBOTS + robot));
                }
                before[env] = absent;
            }
        }
        prop_assert!(left > 50 && came_back > 5);
    }

    /// A team with a robot that is never there is the team without it, to the bit.
    #[test]
    fn a_robot_that_never_comes_is_none(seed in 0..10_000_u64) {
        let mut robots = mixed_team(ROBOTS);
        for (index, robot) in robots.iter_mut().enumerate() {
            robot.start_m = Some([-0.4 + 0.2 * index as f64, -0.4]);
        }
        let smaller = Scenario {
            robots: robots[..ROBOTS - 1].to_vec(),
            engine: Engine::Discs,
            arena_half_width_m: 0.5,
            ..Scenario::default()
        };
        let faults = vec![fault(&robots[ROBOTS - 1].name, Kind::Unavailable, 1.0)];
        let larger =
            Scenario { robots, faults, unavailable_robots: Unavailable::Leave, ..smaller.clone() };
        let mut tables = [smaller, larger].map(|scenario| Table::new(scenario, options(ENVS, seed)));
        let mut chance = chance(seed);
        for _ in 0..STEPS {
            let drives: Vec<[f32; 2]> = (0..ENVS * (ROBOTS - 1)).map(|_| random_drive(&mut chance)).collect();
            let padded: Vec<[f32; 2]> =
                drives.chunks_exact(ROBOTS - 1).flat_map(|row| row.iter().copied().chain([[1.0, 0.0]])).collect();
            tables[0].step(&drives);
            tables[1].step(&padded);
            prop_assert!(tables[0].rescues == tables[1].rescues);
            for (one, other) in zip(tables[0].batch.worlds(), tables[1].batch.worlds()) {
                prop_assert!(one.positions == other.positions[..ROBOTS - 1]);
                prop_assert!(one.victims == other.victims);
            }
            for (one, other) in zip(tables[0].reward.chunks(ROBOTS - 1), tables[1].reward.chunks(ROBOTS)) {
                prop_assert!(one == &other[..ROBOTS - 1]);
            }
        }
    }

    /// What the caller takes out leaves at once, and comes back at once.
    #[test]
    fn the_caller_takes_robots_out_and_puts_them_back(seed in 0..10_000_u64, robot in 0..ROBOTS) {
        let scenario = Scenario { faults: vec![], ..scenario(Engine::Rapier) };
        let mut table = Table::new(scenario.clone(), options(1, seed));
        let mut levels = [HEALTHY; ROBOTS];
        levels[robot][Kind::Unavailable as usize] = 1.0;
        table.batch.set_faults(levels.as_flattened(), None).expect("valid levels");
        let absent = |table: &Table| {
            table.batch.worlds().next().expect("a world").absent(table.batch.rules())
        };
        prop_assert_eq!(absent(&table), 1 << robot);
        let mut chance = chance(seed);
        for _ in 0..10 {
            table.step(&(0..ROBOTS).map(|_| random_drive(&mut chance)).collect::<Vec<_>>());
            prop_assert_eq!(absent(&table), 1 << robot);
        }
        table.batch.set_faults([HEALTHY; ROBOTS].as_flattened(), None).expect("valid levels");
        prop_assert_eq!(absent(&table), 0);
        let world = table.batch.worlds().next().expect("a world");
        let there = present(&scenario, world, 0);
        let (_, at, radius) = there[robot];
        for (other, place, others) in &there {
            prop_assert!(*other == robot || (at - place).norm() > radius + others);
        }
    }
}

#[test]
fn robots_that_flicker_are_refused() {
    let mut scenario = scenario(Engine::Discs);
    scenario.faults[1].value = 0.5;
    let error = innerattn_env::rules::Rules::new(scenario).err().expect("refused").to_string();
    assert_eq!(
        error,
        "scenario.faults[1].value (unavailable) = 0.5: must be 0 or 1 where unavailable_robots = \"leave\""
    );
}
