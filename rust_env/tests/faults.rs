//! What faults do to robots, and what they leave alone.

#![allow(clippy::float_cmp)] // what is compared is the same to the bit, or a level as it was set

mod common;

use common::{ENGINES, Table, chance, coming_and_going, fault, options, random_drive};
use innerattn_env::batch::Autoreset;
use innerattn_env::error::Error;
use innerattn_env::fault::{Fault, HEALTHY, KINDS, Kind, NUM_KINDS};
use innerattn_env::geometry::Vec2;
use innerattn_env::robot::Commands;
use innerattn_env::scenario::{Robot, Scenario};
use proptest::prelude::*;

const EAST: [f32; 2] = [1.0, 0.0];
const STAY: [f32; 2] = [0.0, 0.0];

/// One robot alone in a wide arena: nothing to touch.
fn alone(faults: Vec<Fault>) -> Scenario {
    let robots: Vec<Robot> = Scenario::default().robots.into_iter().take(1).collect();
    let mut scenario =
        Scenario { robots, faults, arena_half_width_m: 100.0, episode_steps: 100, ..Scenario::default() };
    scenario.tasks.truncate(1);
    scenario.tasks[0].needs = vec!["food".into()];
    scenario
}

fn place(table: &Table, robot: usize) -> Vec2 {
    table.batch.worlds().next().expect("a world").positions[robot]
}

fn speed(table: &Table, robot: usize) -> f32 {
    table.batch.worlds().next().expect("a world").velocities[robot].norm()
}

/// Where a robot alone gets in `steps` steps eastwards from rest.
fn way(faults: Vec<Fault>, steps: usize) -> Vec2 {
    let mut table = Table::new(alone(faults), options(1, 0));
    let start = place(&table, 0);
    (0..steps).for_each(|_| table.step(&[EAST]));
    place(&table, 0) - start
}

/// The row that `robot` sees in the table's first world.
fn row(table: &Table, robot: usize) -> Vec<f32> {
    let width = table.batch.rules().layout.width();
    table.obs[robot * width..][..width].to_vec()
}

fn column(table: &Table, name: &str) -> usize {
    let names = table.batch.rules().layout.names();
    names.iter().position(|other| other == name).expect("a column")
}

/// The default team in a long episode, with these faults.
fn team(faults: Vec<Fault>) -> Scenario {
    Scenario { faults, episode_steps: 60, ..Scenario::default() }
}

#[test]
fn half_a_motor_goes_half_as_far_before_the_cap() {
    let (whole, half) = (way(vec![], 2), way(vec![fault("food_0", Kind::MotorGain, 0.5)], 2));
    assert!((2.0 * half - whole).norm() < 1e-5, "{half} {whole}");
    assert!(way(vec![fault("food_0", Kind::MotorGain, 0.0)], 20).norm() <= 0.0);
}

#[test]
fn a_heading_bias_turns_east_into_north() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let (straight, turned) = (way(vec![], 9), way(vec![fault("food_0", Kind::HeadingBias, quarter)], 9));
    assert!(turned.x.abs() < 1e-5 && (turned.y - straight.x).abs() < 1e-5, "{turned}");
    let back = way(vec![fault("food_0", Kind::HeadingBias, -std::f64::consts::PI)], 9);
    assert!((back + straight).norm() < 1e-5, "{back}");
}

#[test]
fn a_speed_limit_is_reached_and_kept() {
    let mut table = Table::new(alone(vec![fault("food_0", Kind::SpeedLimit, 0.3)]), options(1, 0));
    for _ in 0..20 {
        table.step(&[EAST]);
        assert!(speed(&table, 0) < 0.3 + 1e-6);
    }
    assert!((speed(&table, 0) - 0.3).abs() < 1e-6);
    assert!(way(vec![fault("food_0", Kind::SpeedLimit, 0.0)], 20).norm() <= 0.0);
}

#[test]
fn frozen_sensors_repeat_what_they_saw_to_the_bit() {
    let onset = 5;
    let faults = vec![Fault {
        onset_step: onset,
        duration_steps: Some(9),
        ..fault("food_1", Kind::FrozenSensor, 1.0)
    }];
    let mut table = Table::new(team(faults), options(1, 4));
    let mut healthy = Table::new(team(vec![]), options(1, 4));
    let (mut chance, mut held) = (chance(1), vec![]);
    for step in 1..=20 {
        let drives: Vec<[f32; 2]> = (0..4).map(|_| random_drive(&mut chance)).collect();
        table.step(&drives);
        healthy.step(&drives);
        if step == onset {
            held = row(&healthy, 1);
        }
        let frozen = (onset..onset + 9).contains(&step);
        assert_eq!(row(&table, 1), if frozen { held.clone() } else { row(&healthy, 1) }, "step {step}");
        assert_eq!(frozen && step > onset, row(&table, 1) != row(&healthy, 1), "step {step}");
        assert_eq!(row(&table, 0), row(&healthy, 0));
    }
}

#[test]
fn sensors_that_freeze_now_and_then_lag_behind() {
    let mut table = Table::new(team(vec![fault("food_1", Kind::FrozenSensor, 0.5)]), options(1, 4));
    let mut healthy = Table::new(team(vec![]), options(1, 4));
    let (mut chance, mut before, mut repeated) = (chance(1), row(&table, 1), 0);
    for _ in 0..59 {
        let drives: Vec<[f32; 2]> = (0..4).map(|_| random_drive(&mut chance)).collect();
        table.step(&drives);
        healthy.step(&drives);
        let now = row(&table, 1);
        assert!(now == before || now == row(&healthy, 1));
        repeated += usize::from(now == before);
        before = now;
    }
    assert!((15..45).contains(&repeated), "{repeated} of 59");
}

#[test]
fn an_unavailable_robot_neither_drives_nor_helps_but_is_in_the_way() {
    for engine in ENGINES {
        // Two robots that both could help; the second stands between the first and the victim's east.
        let faults = vec![fault("food_1", Kind::Unavailable, 1.0)];
        let mut table = Table::new(Scenario { engine, ..team(faults) }, options(1, 0));
        let still = [0.0; 8];
        table
            .batch
            .set_motion(&[-0.5, 0.0, 0.0, 0.0, 0.9, 0.9, -0.9, -0.9], &still)
            .expect("places inside the arena");
        let start = place(&table, 1);
        table.step(&[STAY, EAST, STAY, STAY]);
        assert_eq!(place(&table, 1), start, "it does not drive");
        assert!(row(&table, 1)[column(&table, "own.available")] <= 0.0);
        assert!(row(&table, 0)[column(&table, "teammate_0.available")] <= 0.0);
        (0..12).for_each(|_| table.step(&[EAST, STAY, STAY, STAY]));
        assert!(place(&table, 1).x > start.x + 0.05, "it is pushed");
        assert!(place(&table, 1).x - place(&table, 0).x > 0.099, "and not passed through");
    }
}

#[test]
fn unavailable_robots_are_nobodys_helpers() {
    let mut helped = [0, 0];
    for (index, faults) in [vec![], vec![fault("food_0", Kind::Unavailable, 1.0)]].into_iter().enumerate() {
        // A radius as wide as the arena: every victim is rescued at once by the nearest able robots.
        let scenario = Scenario { rescue_radius_m: 5.0, ..team(faults) };
        let mut table = Table::new(scenario, options(64, 3));
        for _ in 0..20 {
            table.step(&[STAY; 4 * 64]);
            helped[index] += table.rescues.iter().filter(|rescue| rescue.helpers.contains(&Some(0))).count();
            assert!(!table.rescues.is_empty());
        }
    }
    assert!(helped[0] > 100 && helped[1] == 0, "{helped:?}");
}

#[test]
fn a_blackout_leaves_what_a_robot_knows_of_itself() {
    let mut table = Table::new(team(vec![fault("medical_0", Kind::Blackout, 1.0)]), options(1, 0));
    table.step(&[EAST; 4]);
    let seen = row(&table, 3);
    let names = table.batch.rules().layout.names();
    let known = |name: &String| name == "own.ability.medicine" || name == "own.available";
    for (name, value) in names.iter().zip(seen) {
        assert_eq!(value, if known(name) { 1.0 } else { 0.0 }, "{name}");
    }
}

#[test]
fn lost_communication_takes_the_teammates_and_nothing_else() {
    let mut table = Table::new(team(vec![fault("food_0", Kind::LostCommunication, 1.0)]), options(1, 0));
    let mut healthy = Table::new(team(vec![]), options(1, 0));
    table.step(&[EAST; 4]);
    healthy.step(&[EAST; 4]);
    let names = table.batch.rules().layout.names();
    for (index, name) in names.iter().enumerate() {
        let wanted = if name.starts_with("teammate_") { 0.0 } else { row(&healthy, 0)[index] };
        assert_eq!(row(&table, 0)[index], wanted, "{name}");
    }
    assert_eq!(row(&table, 1), row(&healthy, 1));
}

#[test]
fn noise_shifts_what_a_robot_takes_itself_to_be() {
    let faults = vec![fault("food_0", Kind::PositionNoise, 0.2), fault("food_0", Kind::VelocityNoise, 0.5)];
    let envs = 5000;
    let mut table = Table::new(team(faults), options(envs, 8));
    let mut healthy = Table::new(team(vec![]), options(envs, 8));
    table.step(&vec![EAST; 4 * envs]);
    healthy.step(&vec![EAST; 4 * envs]);
    let width = table.batch.rules().layout.width();
    let error = |env: usize, name: &str| {
        let index = 4 * env * width + column(&table, name);
        f64::from(table.obs[index] - healthy.obs[index])
    };
    for (name, wanted) in [("own.position.x", 0.2), ("own.position.y", 0.2), ("own.velocity.x", 0.5)] {
        let errors: Vec<f64> = (0..envs).map(|env| error(env, name)).collect();
        let mean = errors.iter().sum::<f64>() / envs as f64;
        let deviation = (errors.iter().map(|error| error * error).sum::<f64>() / envs as f64).sqrt();
        assert!(mean.abs() < 4.0 * wanted / (envs as f64).sqrt(), "{name}: mean {mean}");
        assert!((deviation / wanted - 1.0).abs() < 0.04, "{name}: deviation {deviation}");
    }
    // One error of the robot itself, not one for each thing it looks at.
    for env in 0..100 {
        let own = error(env, "own.position.x");
        let other = error(env, "teammate_2.relative_position.x");
        assert!((own + other).abs() < 1e-5, "{own} {other}");
    }
    let true_places =
        |table: &Table| table.batch.worlds().map(|world| world.positions.clone()).collect::<Vec<_>>();
    assert_eq!(true_places(&table), true_places(&healthy));
    // Looking twice at the same moment shows the same.
    let mut again = table.obs.clone();
    table.batch.observe(&mut again);
    assert_eq!(again, table.obs);
}

#[test]
fn faults_begin_and_end_at_their_steps() {
    let faults = vec![
        Fault { onset_step: 3, duration_steps: Some(4), ..fault("food_0", Kind::MotorGain, 0.5) },
        Fault { onset_step: 5, ..fault("food_0", Kind::MotorGain, 0.5) },
    ];
    let mut table = Table::new(alone(faults), options(1, 0));
    let mut seen = vec![];
    for _ in 0..10 {
        let world = table.batch.worlds().next().expect("a world");
        seen.push(world.condition.levels(0)[Kind::MotorGain as usize]);
        table.step(&[STAY]);
    }
    assert_eq!(seen, [1.0, 1.0, 1.0, 0.5, 0.5, 0.25, 0.25, 0.5, 0.5, 0.5]);
}

#[test]
fn random_onsets_come_at_their_rate_and_again() {
    let rate = 0.8; // per second; a control step is 0.1 s
    let faults = vec![Fault {
        onset_step: 10,
        onset_rate_hz: Some(rate),
        duration_steps: Some(5),
        ..fault("food_0", Kind::Unavailable, 1.0)
    }];
    let envs = 4000;
    let mut table = Table::new(alone(faults), options(envs, 2));
    let (mut healthy, mut onsets, mut before) = (0_u32, 0_u32, vec![false; envs]);
    for step in 0..99 {
        let now: Vec<bool> = table.batch.worlds().map(|world| world.condition.unavailable() == 1).collect();
        for (before, now) in before.iter().zip(&now) {
            assert!(step >= 10 || !now);
            if step >= 10 && !before {
                healthy += 1;
                onsets += u32::from(*now);
            }
        }
        before = now;
        table.step(&vec![STAY; envs]);
    }
    let wanted = 1.0 - (-rate * 0.1_f64).exp();
    let found = f64::from(onsets) / f64::from(healthy);
    assert!((found / wanted - 1.0).abs() < 0.03, "{found} {wanted}");
}

#[test]
fn bad_levels_change_nothing() {
    let mut table = Table::new(team(vec![]), options(3, 0));
    table.step(&[EAST; 12]);
    let image = table.batch.snapshot();
    let good = [HEALTHY; 12].as_flattened().to_vec();
    for (kind, value) in [
        (Kind::MotorGain, -0.1),
        (Kind::HeadingBias, 3.2),
        (Kind::PositionNoise, f32::NAN),
        (Kind::Blackout, 1.1),
    ] {
        let mut levels = good.clone();
        levels[7 * NUM_KINDS + kind as usize] = value; // env 1, robot 3
        levels[0] = 0.5;
        let error = table.batch.set_faults(&levels, None).expect_err("a bad level");
        assert!(
            matches!(&error, Error::Fault { kind: name, env: 1, robot: 3, .. } if *name == kind.name()),
            "{error}"
        );
        // Where the mask does not reach, nothing is looked at.
        assert!(table.batch.set_faults(&levels, Some(&[false, false, false])).is_ok());
        assert_eq!(table.batch.snapshot(), image);
    }
    assert!(table.batch.set_faults(&good[1..], None).is_err());
}

#[test]
fn the_callers_faults_hold_until_the_episode_ends() {
    let scenario = Scenario { episode_steps: 8, ..team(vec![fault("food_0", Kind::MotorGain, 0.5)]) };
    let options = innerattn_env::batch::Options { autoreset: Autoreset::SameStep, ..options(2, 0) };
    let mut table = Table::new(scenario, options);
    let gain = |table: &Table, env: usize| {
        let world = table.batch.worlds().nth(env).expect("a world");
        world.condition.levels(0)[Kind::MotorGain as usize]
    };
    table.step(&[EAST; 8]);
    let mut levels = [HEALTHY; 8];
    levels[0][Kind::MotorGain as usize] = 0.25;
    table.batch.set_faults(levels.as_flattened(), Some(&[true, false])).expect("good levels");
    for _ in 1..8 {
        assert_eq!([gain(&table, 0), gain(&table, 1)], [0.25, 0.5]);
        table.step(&[EAST; 8]);
    }
    assert_eq!([gain(&table, 0), gain(&table, 1)], [0.5, 0.5]);
}

/// What a batch of healthy or faulty worlds shows over many steps, a row of bits for each step.
fn played(scenario: &Scenario, seed: u64, stayers: Option<usize>) -> Vec<Vec<u32>> {
    let mut table = Table::new(scenario.clone(), options(4, seed));
    let mut chance = chance(seed);
    let robots = scenario.robots.len();
    let step = |_| {
        let mut drives: Vec<[f32; 2]> = (0..4 * robots).map(|_| random_drive(&mut chance)).collect();
        if let Some(robot) = stayers {
            drives.chunks_exact_mut(robots).for_each(|row| row[robot] = STAY);
        }
        table.step(&drives);
        table.shown(0, 4)
    };
    (0..60).map(step).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Severity 0 of any kind at any time is no fault at all, to the bit.
    #[test]
    fn a_fault_of_no_severity_is_none(
        kind in 0..NUM_KINDS, robot in 0..4_usize, onset in 0..25_u32, random: bool, seed in 0..1000_u64,
    ) {
        let healthy = Scenario { arena_half_width_m: 0.6, spawn_clearance_m: 0.1, ..Scenario::default() };
        let faulty = Scenario {
            faults: vec![Fault {
                onset_step: onset,
                onset_rate_hz: random.then_some(3.0),
                ..fault(&healthy.robots[robot].name, KINDS[kind], f64::from(HEALTHY[kind]))
            }],
            ..healthy.clone()
        };
        prop_assert!(played(&healthy, seed, None) == played(&faulty, seed, None));
    }

    /// A motor without force: the robot is one that is told to stay.
    #[test]
    fn a_dead_motor_is_a_robot_that_stays(robot in 0..4_usize, seed in 0..1000_u64) {
        let healthy = Scenario { arena_half_width_m: 0.6, spawn_clearance_m: 0.1, ..Scenario::default() };
        let faults = vec![fault(&healthy.robots[robot].name, Kind::MotorGain, 0.0)];
        let faulty = Scenario { faults, ..healthy.clone() };
        prop_assert!(played(&healthy, seed, Some(robot)) == played(&faulty, seed, None));
    }

    /// Faults of the senses move nothing: the same drives lead to the same places and rescues.
    #[test]
    fn senses_do_not_move_the_world(seed in 0..1000_u64, value in 0.0..1.0_f64) {
        let healthy = Scenario { arena_half_width_m: 0.6, spawn_clearance_m: 0.1, ..Scenario::default() };
        let senses = [
            Kind::PositionNoise, Kind::VelocityNoise, Kind::FrozenSensor, Kind::Blackout, Kind::LostCommunication,
        ];
        let of = |robot: &Robot| senses.map(|kind| fault(&robot.name, kind, value));
        let faults = healthy.robots.iter().flat_map(of).collect();
        let mut tables = [healthy.clone(), Scenario { faults, ..healthy }]
            .map(|scenario| Table::new(scenario, options(4, seed)));
        let mut chance = chance(seed);
        for _ in 0..60 {
            let drives: Vec<[f32; 2]> = (0..16).map(|_| random_drive(&mut chance)).collect();
            for table in &mut tables {
                table.step(&drives);
            }
            prop_assert!(tables[0].reward == tables[1].reward && tables[0].rescues == tables[1].rescues);
        }
    }

    /// Whatever fails, observations and rewards stay finite, and actions are still checked.
    #[test]
    fn nothing_seen_is_ever_other_than_a_number(seed in 0..1000_u64) {
        let healthy = Scenario::default();
        let faults = coming_and_going(&healthy.robots);
        let mut table = Table::new(Scenario { faults, observe_faults: true, ..healthy }, options(8, seed));
        let mut chance = chance(seed);
        for _ in 0..60 {
            let drives: Vec<[f32; 2]> = (0..32).map(|_| random_drive(&mut chance)).collect();
            table.step(&drives);
            prop_assert!(table.obs.iter().chain(&table.reward).all(|number| number.is_finite()));
        }
        prop_assert!(table.try_step(Commands::Discrete(&[7; 32])).is_err());
    }
}
