//! Robots of different layers never influence one another, and those that set their velocity have it at once.

use innerattn_env::geometry::Vec2;
use innerattn_env::physics::Workspace;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Actions, DriveMode, Scenario};
use innerattn_env::world::World;

use crate::common::{
    ENGINES, Table, chance, mixed_team, options, random_drive, some_obstacles, with_layers, with_leaving,
};

/// Nine unlike robots in three layers in an arena where there is hardly room for them in one.
fn crowd() -> Scenario {
    let tight = Scenario { arena_half_width_m: 0.6, spawn_clearance_m: 0.0, ..Scenario::default() };
    with_layers(Scenario { robots: mixed_team(9), obstacles: some_obstacles(), ..tight })
}

/// The same with the robots of one layer and what blocks them, and their indices.
fn alone(scenario: &Scenario, layer: &str) -> (Scenario, Vec<usize>, Vec<usize>) {
    let mut one = scenario.clone();
    one.robots.retain(|robot| robot.layer == layer);
    one.obstacles.retain(|obstacle| obstacle.blocks(layer));
    one.obstacles.iter_mut().for_each(|obstacle| obstacle.layers = None);
    one.tasks.truncate(1);
    one.tasks[0].needs = vec![one.robots[0].abilities.names().next().expect("an ability").into()].into();
    let robots = (0..scenario.robots.len()).filter(|robot| scenario.robots[*robot].layer == layer);
    let obstacles = (0..scenario.obstacles.len()).filter(|index| scenario.obstacles[*index].blocks(layer));
    (one, robots.collect(), obstacles.collect())
}

#[test]
fn each_layer_moves_as_if_it_were_alone_to_the_bit() {
    for engine in ENGINES {
        let scenario = Scenario { engine, ..crowd() };
        let rules = Rules::new(scenario.clone()).expect("a valid scenario");
        let layers = scenario.layers().into_iter().map(|layer| {
            let (one, robots, obstacles) = alone(&scenario, layer);
            (Rules::new(one).expect("a valid scenario"), robots, obstacles)
        });
        let layers: Vec<_> = layers.collect();
        let (mut workspace, mut chance) = (Workspace::default(), chance(21));
        let (mut pushes, mut covered) = (0, 0);
        for episode in 0..60 {
            let mut world = World::new(&rules, 1, episode);
            for _ in 0..40 {
                let absent = if episode % 3 == 0 { 1 << chance.below(9) } else { 0 };
                for robot in 0..9 {
                    let drive = random_drive(&mut chance).into();
                    let velocity = rules.team[robot].driven(world.velocities[robot], drive, 1.0);
                    world.velocities[robot] = if absent >> robot & 1 == 1 { Vec2::zeros() } else { velocity };
                }
                let (mut positions, mut velocities) = (world.positions.clone(), world.velocities.clone());
                let touched = rules.physics.advance(
                    &mut workspace,
                    &mut positions,
                    &mut velocities,
                    &world.obstacles,
                    absent,
                );
                for (one, robots, obstacles) in &layers {
                    let of = |all: &[Vec2], which: &[usize]| {
                        which.iter().map(|index| all[*index]).collect::<Vec<Vec2>>()
                    };
                    let own = |bits: u64| {
                        let each = robots.iter().enumerate();
                        each.fold(0, |own, (index, robot)| own | (bits >> robot & 1) << index)
                    };
                    let (mut places, mut speeds) =
                        (of(&world.positions, robots), of(&world.velocities, robots));
                    let centres = of(&world.obstacles, obstacles);
                    let own_touched =
                        one.physics.advance(&mut workspace, &mut places, &mut speeds, &centres, own(absent));
                    assert_eq!(places, of(&positions, robots), "{engine:?}");
                    assert_eq!(speeds, of(&velocities, robots), "{engine:?}");
                    assert_eq!(own_touched, own(touched), "{engine:?}");
                }
                pushes += touched.count_ones();
                for (robot, other) in (0..9).flat_map(|robot| (0..robot).map(move |other| (robot, other))) {
                    let reach = rules.team[robot].radius + rules.team[other].radius;
                    covered += u32::from((positions[robot] - positions[other]).norm() < 0.5 * reach);
                }
                (world.positions, world.velocities) = (positions, velocities);
            }
        }
        assert!(pushes > 2000 && covered > 200, "{engine:?}: {pushes} pushes, {covered} covered");
    }
}

#[test]
fn robots_start_and_come_back_clear_of_their_own_layer_alone() {
    let mut scenario = Scenario { arena_half_width_m: 0.4, rescue_radius_m: 0.4, ..Scenario::default() };
    scenario.spawn_clearance_m = 0.0;
    for (robot, layer) in scenario.robots.iter_mut().zip(["ground", "air", "water", "ground"]) {
        (robot.radius_m, robot.layer) = (0.15, layer.into());
    }
    let crowded = Scenario { robots: scenario.robots.iter().cycle().take(4).cloned().collect(), ..scenario };
    let mut covered = 0;
    let mut table = Table::new(with_leaving(crowded.clone()), options(50, 1));
    for _ in 0..100 {
        table.step(&[[0.0; 2]; 200]);
        for world in table.batch.worlds() {
            let rules = table.batch.rules();
            let absent = world.absent(rules);
            for robot in (0..4).filter(|robot| absent >> robot & 1 == 0) {
                for other in (0..robot).filter(|other| absent >> other & 1 == 0) {
                    let apart = (world.positions[robot] - world.positions[other]).norm();
                    let same = rules.team[robot].layer == rules.team[other].layer;
                    assert!(!same || apart > 0.2999, "{apart}");
                    covered += u32::from(apart < 0.15);
                }
            }
        }
    }
    assert!(covered > 100, "{covered}");
    // Given places: one of each layer may be at the same.
    let mut starts = crowded;
    for robot in &mut starts.robots[..3] {
        robot.start_m = Some([0.1, 0.1]);
    }
    assert!(Rules::new(starts.clone()).is_ok());
    starts.robots[2].layer = "air".into();
    let refused = Rules::new(starts).err().expect("two of one layer at a place").to_string();
    assert!(refused.starts_with("scenario.robots (their number) = 4: no room"), "{refused}");
}

#[test]
fn a_robot_may_start_in_what_does_not_block_it() {
    let block = |layers: &[&str]| {
        let mut scenario = Scenario { spawn_clearance_m: 0.0, wall_clearance_m: 0.0, ..Scenario::default() };
        scenario.robots[3].layer = "air".into();
        scenario.robots[3].start_m = Some([0.5, 0.5]);
        scenario.obstacles = some_obstacles();
        scenario.obstacles[3].position_m = Some([0.5, 0.5]);
        scenario.obstacles[3].layers = Some(layers.iter().map(ToString::to_string).collect());
        Rules::new(scenario).is_ok()
    };
    assert!(block(&["ground"]) && !block(&["air"]) && !block(&["ground", "air"]));
}

#[test]
fn a_set_velocity_is_there_in_the_step_and_gone_in_the_next() {
    for engine in ENGINES {
        let mut scenario = Scenario { engine, arena_half_width_m: 5.0, ..Scenario::default() };
        scenario.actions = Actions::Continuous;
        scenario.robots.iter_mut().for_each(|robot| robot.drive = DriveMode::Velocity);
        let speeds: Vec<f32> = scenario.robots.iter().map(|robot| robot.max_speed_mps as f32).collect();
        let mut table = Table::new(scenario, options(1, 0));
        let mut chance = chance(22);
        for _ in 0..50 {
            let places: Vec<f32> = [[-3.0, 3.0], [-3.0, 1.0], [-3.0, -1.0], [-3.0, -3.0]].concat();
            table.batch.set_motion(&places, &[0.5; 8]).expect("a valid state");
            let actions: Vec<[f32; 2]> =
                (0..4).map(|_| [chance.between(-0.7, 0.7), chance.between(-0.7, 0.7)]).collect();
            table.step(&actions);
            let world = table.batch.worlds().next().expect("one world").clone();
            if world.step == 0 {
                continue;
            }
            for robot in 0..4 {
                let wanted = Vec2::from(actions[robot]) * speeds[robot];
                assert!((world.velocities[robot] - wanted).norm() < 1e-6);
                let way = world.positions[robot] - Vec2::new(places[2 * robot], places[2 * robot + 1]);
                assert!((way - wanted * 0.1).norm() < 1e-5);
            }
            table.step(&[[0.0; 2]; 4]);
            let stood = table.batch.worlds().next().expect("one world");
            assert!(stood.velocities.iter().all(|velocity| *velocity == Vec2::zeros()));
        }
    }
}
