//! Worlds with keys of motion at their extremes: whatever scenario is taken, its robots start apart, stay
//! inside, and never overlap by more than the pages promise. No faults are drawn.
//!
//! `INNERATTN_FUZZ_SECONDS` says how long it goes on.

use innerattn_env::batch::Batch;
use innerattn_env::error::Error;
use innerattn_env::rng::Stream;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{
    Actions, Communication, DriveMode, Engine, MAX_TRAVEL_RADII, Map, Obstacle, Robot, Scenario, Shape,
    Share, Situation, Task,
};
use innerattn_env::world::World;

use crate::common::{ENGINES, Table, options};
use crate::containment::{PLAYS, check_uncrossed, deepest};
use crate::fuzz::for_a_while;

/// Deepest overlap at a period's end with each engine, as a share of the smaller of the two.
const MOST: [f32; 2] = [0.15, 0.05];
const ENVS: usize = 2;
const STEPS: usize = 40;

fn real(source: &mut Stream) -> f64 {
    f64::from(source.between(0.0, 1.0))
}

/// From `low` to `high`, evenly by magnitude, and one time in four one of the two.
fn scaled(source: &mut Stream, low: f64, high: f64) -> f64 {
    match source.below(8) {
        0 => low,
        1 => high,
        _ => (low * (high / low).powf(real(source))).clamp(low, high),
    }
}

fn one_of<T: Copy>(source: &mut Stream, values: &[T]) -> T {
    values[source.below(values.len())]
}

/// An obstacle that blocks all, or the layer of one robot.
fn obstacle(source: &mut Stream, half: f64, layers: &[String]) -> Obstacle {
    let size = |source: &mut Stream| scaled(source, 0.005, half * 0.4);
    let fixed = source.below(4) == 0;
    let round = source.below(2) == 0;
    Obstacle {
        shape: if round { Shape::Disc } else { Shape::Box },
        radius_m: round.then(|| size(source)),
        half_extents_m: (!round).then(|| [size(source), size(source)]),
        position_m: fixed.then(|| [(2.0 * real(source) - 1.0) * half, (2.0 * real(source) - 1.0) * half]),
        layers: (source.below(3) == 0).then(|| vec![layers[source.below(layers.len())].clone()]),
    }
}

/// A scenario with the keys of motion at random, more often than not at its extremes.
fn extreme(source: &mut Stream) -> Scenario {
    let engine = one_of(source, &ENGINES);
    let half = scaled(source, 0.2, 100.0);
    let count = one_of(source, &[1, 2, 2, 3, 4, 4, 6, 8, 16, 64]);
    let largest = (half * 0.499).min(10.0);
    let (small, large) = match source.below(3) {
        0 => (0.005, largest),
        1 => (0.03_f64.min(largest), 0.08_f64.min(largest)),
        _ => {
            let radius = scaled(source, 0.005, largest);
            (radius, (radius * scaled(source, 1.0, 16.0)).min(largest))
        }
    };
    let ratio = if engine == Engine::Rapier { 16.0 } else { 100.0 };
    let ratio = one_of(source, &[1.0, ratio, 4.0]);
    let light = scaled(source, 0.01, 1000.0 / ratio);
    let layers = one_of(source, &[&["ground"][..], &["ground", "air"]]);
    let dt_s = scaled(source, 0.001, 1.0);
    let substeps = scaled(source, 1.0, 40.0).round() as u32;
    let mut robots: Vec<Robot> = (0..count)
        .map(|index| Robot {
            name: format!("robot_{index}"),
            kind: "robot".into(),
            abilities: vec!["aid".into()].into(),
            max_speed_mps: scaled(source, 0.01, 100.0),
            mass_kg: scaled(source, light, light * ratio),
            radius_m: scaled(source, small, large),
            drive_force_n: scaled(source, 0.001, 1e5),
            drive: one_of(
                source,
                &[DriveMode::Force, DriveMode::Velocity, DriveMode::Unicycle, DriveMode::Differential],
            ),
            max_turn_rad_s: scaled(source, 0.01, 3.0),
            acceleration_m_s2: scaled(source, 0.01, 1e5),
            turn_acceleration_rad_s2: scaled(source, 0.01, 1e6),
            wheel_base_m: None,
            layer: one_of(source, layers).into(),
            start_m: None,
            battery: None,
            load: None,
            sight_m: None,
            field_of_view_deg: 360.0,
            range_sensor: None,
        })
        .collect();
    if engine == Engine::Rapier {
        // No farther in a substep than is taken, and mostly as far.
        let share = if source.below(2) == 0 { 1.0 } else { real(source).max(0.01) };
        let alike = source.below(2) == 0;
        let sizes: Vec<(String, f64)> =
            robots.iter().map(|robot| (robot.layer.clone(), robot.radius_m)).collect();
        for robot in &mut robots {
            let same = sizes.iter().filter(|(layer, _)| *layer == robot.layer);
            let smallest = same.map(|(_, radius)| *radius).fold(f64::INFINITY, f64::min);
            let most = (3.0 * smallest * f64::from(substeps) / dt_s * share).clamp(0.01, 100.0);
            robot.max_speed_mps = if alike { most } else { robot.max_speed_mps.min(most) };
        }
    }
    let obstacles = one_of(source, &[0, 0, 1, 3, 8]);
    let layers: Vec<String> = robots.iter().map(|robot| robot.layer.clone()).collect();
    Scenario {
        situation: one_of(source, &[Situation::Single, Situation::Mixed]),
        obstacles: (0..obstacles).map(|_| obstacle(source, half, &layers)).collect(),
        robots,
        tasks: vec![Task::new("task", vec!["aid".into()])],
        arena_half_width_m: half,
        rescue_radius_m: 10.0,
        spawn_clearance_m: 0.0,
        wall_clearance_m: 0.0,
        episode_steps: one_of(source, &[10, 25, 100]),
        dt_s,
        substeps,
        damping: one_of(source, &[0.0, 0.25, 1.0, 0.01]),
        friction: if engine == Engine::Rapier { one_of(source, &[0.0, 0.5, 10.0]) } else { 0.0 },
        engine,
        actions: one_of(source, &[Actions::Discrete, Actions::Continuous]),
        communication: communication(source),
        map: (source.below(3) == 0).then(|| map(source)),
        ..Scenario::default()
    }
}

/// A map with few or many solid cells, large or small ones.
fn map(source: &mut Stream) -> Map {
    let side = one_of(source, &[2, 3, 5, 10, 50, 200]);
    let solid = one_of(source, &[0.02, 0.1, 0.3, 0.6]);
    let mut row = || (0..side).map(|_| if real(source) < solid { '#' } else { '.' }).collect();
    Map { rows: (0..side).map(|_| row()).collect(), layers: None }
}

/// A radio of some sort, or none.
fn communication(source: &mut Stream) -> Option<Communication> {
    let found = Communication {
        range_m: (source.below(2) == 0).then(|| scaled(source, 0.005, 1000.0)),
        delay_steps: one_of(source, &[0, 1, 20]),
        loss: one_of(source, &[0.0, 0.5, 0.999_999_99]),
        share: Share::Nothing,
    };
    (source.below(2) == 0).then_some(found)
}

/// How far the fastest robot goes in a period, in smallest radii.
fn travel(scenario: &Scenario) -> f64 {
    let fastest = scenario.robots.iter().map(|robot| robot.max_speed_mps).fold(0.0, f64::max);
    let smallest = scenario.robots.iter().map(|robot| robot.radius_m).fold(f64::INFINITY, f64::min);
    fastest * scenario.dt_s / smallest
}

#[test]
fn robots_stay_apart_in_every_scenario_that_is_taken() {
    let mut worst = [0.0_f32; 2];
    for_a_while("scenarios at their extremes", |source| {
        let scenario = extreme(source);
        match Rules::new(scenario.clone()).and_then(|rules| Batch::new(rules, options(ENVS, 1))) {
            Ok(_) => {}
            Err(Error::Scenario { .. }) => return false,
            Err(other) => panic!("{other}"),
        }
        let engine = ENGINES.iter().position(|engine| *engine == scenario.engine).expect("an engine");
        let short = travel(&scenario) <= MAX_TRAVEL_RADII;
        let play = one_of(source, &PLAYS);
        let mut table = Table::new(scenario, options(ENVS, 1));
        for _ in 0..STEPS {
            let before: Vec<World> = table.batch.worlds().cloned().collect();
            let drives = |world: &World, source: &mut Stream| {
                (0..world.positions.len()).map(|robot| play.drive(world, robot, source)).collect::<Vec<_>>()
            };
            let actions: Vec<[f32; 2]> = before.iter().flat_map(|world| drives(world, source)).collect();
            table.step(&actions);
            let rules = table.batch.rules();
            for (world, before) in table.batch.worlds().zip(&before) {
                let numbers = world.positions.iter().chain(&world.velocities).flatten();
                assert!(numbers.copied().all(f32::is_finite), "{:?}", rules.scenario);
                let overlap = deepest(rules, world);
                assert!(overlap < MOST[engine], "{overlap} of the smaller: {:?}", rules.scenario);
                worst[engine] = worst[engine].max(overlap);
                if short && world.episode == before.episode {
                    check_uncrossed(rules, world, &before.positions);
                }
            }
        }
        true
    });
    for (engine, worst) in ENGINES.iter().zip(worst) {
        println!("{engine:?}: overlaps of at most {:.1} % of the smaller", 100.0 * worst);
    }
}

#[test]
fn episodes_start_with_nobody_in_each_other() {
    let mut starts = 0;
    for_a_while("crowded scenarios", |source| {
        let mut scenario = extreme(source);
        let largest = scenario.arena_half_width_m * 0.499;
        for robot in &mut scenario.robots {
            robot.radius_m = (largest * one_of(source, &[1.0, 0.9, 0.7, 0.5, 0.3, 0.1])).clamp(0.005, 10.0);
            robot.max_speed_mps = 0.01;
        }
        let Ok(rules) = Rules::new(scenario) else { return false };
        for stream in 0..100 {
            let world = World::new(&rules, 0, stream);
            let overlap = deepest(&rules, &world);
            assert!(overlap <= 0.0, "{overlap} of the smaller: {world:?} {:?}", rules.scenario);
        }
        starts += 100;
        true
    });
    println!("{starts} starts");
}
