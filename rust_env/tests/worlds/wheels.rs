//! Robots on wheels: limits, arcs, contacts, faults and starts, in 64 bits where a world has 32.
#![allow(clippy::float_cmp)] // the same number, not one near it

use std::f64::consts::{PI, TAU};

use innerattn_env::fault::{Fault, Kind};
use innerattn_env::rng::Stream;
use innerattn_env::robot::Commands;
use innerattn_env::scenario::{Actions, DriveMode, Engine, Robot, Scenario};
use innerattn_env::wheels::Heading;
use innerattn_env::world::World;
use proptest::prelude::*;

use crate::common::{
    ENGINES, Table, chance, coming_and_going, fault, mixed_team, options, with_layers, with_leaving,
    with_sight, with_wheels,
};

const ENVS: usize = 4;
const DT: f64 = 0.1;
/// What 32 bits may lose of a speed or of an angle in a period.
const NEAR: f64 = 2e-5;

/// One team on wheels in an arena without contacts.
fn open(actions: Actions) -> Scenario {
    let robots = mixed_team(8);
    with_wheels(Scenario {
        robots,
        actions,
        engine: Engine::None,
        arena_half_width_m: 50.0,
        ..Scenario::default()
    })
}

fn one(table: &Table) -> &World {
    table.batch.worlds().next().expect("a world")
}

/// Any two numbers that an action may be.
fn pair(source: &mut Stream) -> [f32; 2] {
    let share = |source: &mut Stream| [source.between(-1.0, 1.0), 1.0, -1.0, 0.0][source.below(4)];
    [share(source), share(source)]
}

fn step(table: &mut Table, source: &mut Stream) {
    let rows = table.reward.len();
    match table.batch.rules().scenario.actions {
        Actions::Discrete => {
            let actions: Vec<i64> = (0..rows).map(|_| source.below(5) as i64).collect();
            table.try_step(Commands::Discrete(&actions)).expect("actions");
        }
        Actions::Continuous => {
            let actions: Vec<[f32; 2]> = (0..rows).map(|_| pair(source)).collect();
            table.step(&actions);
        }
    }
}

/// Speed and turn rate of the period that a world has just done, from its chord, and the speeds of both wheels.
struct Motion {
    speed: f64,
    turn: f64,
    wheels: [f64; 2],
}

impl Motion {
    fn of(world: &World, robot: usize, known: &Robot, turned: f64) -> Self {
        let (heading, velocity) = (world.headings[robot], world.velocities[robot]);
        let turn = f64::from(heading.turn_rate);
        let half = 0.5 * DT * turn;
        let way = f64::from(heading.angle) - half + turned;
        let along = f64::from(velocity.x) * way.cos() + f64::from(velocity.y) * way.sin();
        let speed = along / if half == 0.0 { 1.0 } else { half.sin() / half };
        let spread = 0.5 * known.track_m() * turn;
        Self { speed, turn, wheels: [speed - spread, speed + spread] }
    }
}

#[test]
fn speeds_and_turn_rates_keep_their_limits() {
    for actions in [Actions::Discrete, Actions::Continuous] {
        let scenario = open(actions);
        let robots = scenario.robots.clone();
        let mut table = Table::new(scenario, options(ENVS, 1));
        let (mut source, mut fast, mut turning) = (chance(1), 0, 0);
        let mut before: Vec<World> = table.batch.worlds().cloned().collect();
        for _ in 0..400 {
            step(&mut table, &mut source);
            let now: Vec<World> = table.batch.worlds().cloned().collect();
            for (old, new) in before.iter().zip(&now).filter(|(old, new)| old.episode == new.episode) {
                for (robot, known) in robots.iter().enumerate().filter(|(_, known)| known.has_wheels()) {
                    let [was, is] = [old, new].map(|world| Motion::of(world, robot, known, 0.0));
                    let near = |value: f64, most: f64| value.abs() <= most * (1.0 + NEAR) + NEAR;
                    assert!(near(is.turn, known.max_turn_rad_s), "{}: {}", known.name, is.turn);
                    assert!(near(is.speed, known.max_speed_mps), "{}: {}", known.name, is.speed);
                    let gain = known.acceleration_m_s2 * DT;
                    if known.drive == DriveMode::Unicycle {
                        assert!(near(is.speed - was.speed, gain), "{} {}", is.speed, was.speed);
                        let most = known.turn_acceleration_rad_s2 * DT;
                        assert!(near(is.turn - was.turn, most), "{} {}", is.turn, was.turn);
                    } else {
                        for (is, was) in is.wheels.iter().zip(was.wheels) {
                            assert!(near(*is, known.max_speed_mps), "{is}");
                            assert!(near(is - was, gain), "{is} {was}");
                        }
                    }
                    fast += i32::from(is.speed.abs() > 0.99 * known.max_speed_mps);
                    turning += i32::from(is.turn.abs() > 0.99 * known.max_turn_rad_s.min(10.0));
                }
            }
            before = now;
        }
        assert!(fast > 100 && turning > 100, "{fast} {turning}");
    }
}

#[test]
fn a_free_robot_ends_where_its_arc_does() {
    let mut table = Table::new(open(Actions::Continuous), options(ENVS, 2));
    let robots = table.batch.rules().scenario.robots.clone();
    let mut source = chance(2);
    let mut arcs = 0;
    for _ in 0..100 {
        let before: Vec<World> = table.batch.worlds().cloned().collect();
        step(&mut table, &mut source);
        for (old, new) in
            before.iter().zip(table.batch.worlds()).filter(|(old, new)| old.episode == new.episode)
        {
            for (robot, known) in robots.iter().enumerate().filter(|(_, known)| known.has_wheels()) {
                // The arc in ten thousand short ways.
                let Motion { speed, turn, .. } = Motion::of(new, robot, known, 0.0);
                let (mut at, parts) = ([0.0_f64; 2], 10_000);
                for part in 0..parts {
                    let time = DT * (f64::from(part) + 0.5) / f64::from(parts);
                    let angle = f64::from(old.headings[robot].angle) + turn * time;
                    let way = speed * DT / f64::from(parts);
                    at = [at[0] + way * angle.cos(), at[1] + way * angle.sin()];
                }
                let gone = new.positions[robot] - old.positions[robot];
                let miss = (f64::from(gone.x) - at[0]).hypot(f64::from(gone.y) - at[1]);
                assert!(miss < 5e-6, "{}: {miss}", known.name); // of places up to 50 m away
                let end = f64::from(old.headings[robot].angle) + turn * DT;
                let apart = (end - f64::from(new.headings[robot].angle)).rem_euclid(TAU);
                assert!(apart.min(TAU - apart) < 1e-6);
                arcs += i32::from((turn * DT).abs() > 0.2 && speed.abs() > 0.3);
            }
        }
    }
    assert!(arcs > 200, "{arcs}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// A world that is turned goes on turned: actions of robots on wheels do not turn.
    #[test]
    fn a_turned_world_goes_on_turned(seed: u64, angle in -PI..PI, continuous: bool) {
        let actions = if continuous { Actions::Continuous } else { Actions::Discrete };
        let mut scenario = open(actions);
        scenario.robots.iter_mut().for_each(|robot| {
            if !robot.has_wheels() {
                robot.drive = DriveMode::Differential;
            }
        });
        let robots = scenario.robots.len();
        let mut tables = [(); 2].map(|()| Table::new(scenario.clone(), options(1, seed)));
        let turned = |[x, y]: [f64; 2]| {
            let (sin, cos) = angle.sin_cos();
            [cos * x - sin * y, sin * x + cos * y]
        };
        // Nearer to the centre, so that all of it is in the arena when it is turned.
        let places = &one(&tables[0]).positions;
        let nearer: Vec<f32> = places.iter().flat_map(|at| [0.1 * at.x, 0.1 * at.y]).collect();
        tables[0].batch.set_motion(&nearer, &vec![0.0; 2 * robots]).expect("places");
        let start = one(&tables[0]).clone();
        let wide = |vector: &innerattn_env::geometry::Vec2| [vector.x, vector.y].map(f64::from);
        let narrow = |at| turned(wide(at)).map(|metres| metres as f32);
        let places: Vec<f32> = start.positions.iter().flat_map(narrow).collect();
        let wrapped = |angle: f64| (angle + PI).rem_euclid(TAU) - PI;
        let most = std::f32::consts::PI;
        let other = |one: &Heading| (wrapped(f64::from(one.angle) + angle) as f32).clamp(-most, most);
        let headings: Vec<f32> = start.headings.iter().map(other).collect();
        tables[1].batch.set_motion(&places, &vec![0.0; 2 * robots]).expect("places");
        tables[1].batch.set_headings(&headings).expect("headings");
        for number in 0..20 {
            for table in &mut tables {
                step(table, &mut chance(seed ^ number));
            }
            let [plain, other] = [0, 1].map(|index| one(&tables[index]).clone());
            for robot in 0..robots {
                let [x, y] = turned(wide(&plain.positions[robot]));
                let [there_x, there_y] = wide(&other.positions[robot]);
                let miss = (there_x - x).hypot(there_y - y);
                prop_assert!(miss < 1e-4, "{miss}"); // of places up to 10 m away, in 20 steps
                let [from, to] = [&plain, &other].map(|world| f64::from(world.headings[robot].angle));
                let apart = wrapped(from + angle - to);
                prop_assert!(apart.abs() < 1e-4 || TAU - apart.abs() < 1e-4, "{apart}");
            }
        }
    }
}

/// One robot on wheels that stands in the middle and points along x, and a victim that it helps.
fn alone(drive: DriveMode, engine: Engine, faults: Vec<Fault>) -> Table {
    let mut scenario = Scenario { engine, faults, actions: Actions::Continuous, ..Scenario::default() };
    scenario.robots.truncate(1);
    scenario.robots[0].drive = drive;
    scenario.robots[0].start_m = Some([0.0, 0.0]);
    scenario.tasks.truncate(1);
    scenario.tasks[0].needs = vec!["food".into()].into();
    let mut table = Table::new(scenario, options(1, 0));
    table.batch.set_headings(&[0.0]).expect("a heading");
    table
}

/// The action that drives straight ahead or turns to the left.
fn action(drive: DriveMode, ahead: f32, left: f32) -> [[f32; 2]; 1] {
    if drive == DriveMode::Unicycle { [[ahead, left]] } else { [[ahead - left, ahead + left]] }
}

const DRIVES: [DriveMode; 2] = [DriveMode::Unicycle, DriveMode::Differential];

#[test]
fn actions_drive_and_turn_as_they_are_named() {
    for drive in DRIVES {
        let mut table = alone(drive, Engine::Discs, vec![]);
        let mut speeds = vec![];
        for _ in 0..4 {
            table.step(&action(drive, 1.0, 0.0));
            speeds.push(one(&table).velocities[0].x);
        }
        assert_eq!(speeds, [0.5, 1.0, 1.0, 1.0], "5 m/s2 up to 1 m/s");
        assert_eq!(one(&table).headings[0].angle, 0.0);
        (0..4).for_each(|_| table.step(&action(drive, 0.0, 0.0)));
        assert!(one(&table).velocities[0].norm() < 1e-6);
        let at = one(&table).positions[0];
        (0..3).for_each(|_| table.step(&action(drive, 0.0, 1.0)));
        let heading = one(&table).headings[0];
        assert_eq!(heading.turn_rate, 4.0);
        let wanted = if drive == DriveMode::Unicycle { 0.2 + 0.4 + 0.4 } else { 3.0 * 0.4 };
        assert!((heading.angle - wanted).abs() < 1e-5, "{}", heading.angle);
        assert!((one(&table).positions[0] - at).norm() < 1e-6, "it turns where it stands");
        table.batch.set_headings(&[0.0]).expect("a heading");
        (0..2).for_each(|_| table.step(&action(drive, -1.0, 0.0)));
        assert!((one(&table).velocities[0].x + 1.0).abs() < 1e-5, "backwards as fast");
    }
}

#[test]
fn a_wall_stops_wheels_along_their_way_and_turns_nobody() {
    for (engine, drive) in ENGINES.into_iter().flat_map(|engine| DRIVES.map(|drive| (engine, drive))) {
        let mut table = alone(drive, engine, vec![]);
        table.batch.set_motion(&[0.945, 0.0], &[0.0, 0.0]).expect("a place");
        table.batch.set_headings(&[0.3]).expect("a heading");
        (0..10).for_each(|_| table.step(&action(drive, 1.0, 0.0)));
        let world = one(&table);
        assert_eq!(world.headings[0].angle, 0.3, "a contact turns nobody");
        assert!(world.positions[0].x < 0.951 && world.positions[0].y > 0.1, "it slides along the wall");
        // Wheels roll with the part of the velocity along the heading, and gain 0.5 m/s a period.
        let along = world.velocities[0].y * 0.3_f32.sin();
        assert!((along + 0.5).min(1.0) * 0.3_f32.sin() - world.velocities[0].y < 1e-3, "{world:?}");
        table.step(&action(drive, -1.0, 0.0));
        table.step(&action(drive, -1.0, 0.0));
        let velocity = one(&table).velocities[0];
        assert!((velocity.y / velocity.x - 0.3_f32.tan()).abs() < 1e-4, "no side slip is left");
    }
}

#[test]
fn faults_weaken_slow_and_mislead_wheels() {
    for drive in DRIVES {
        let far = |faults: Vec<Fault>| {
            let mut table = alone(drive, Engine::Discs, faults);
            (0..6).for_each(|_| table.step(&action(drive, 1.0, 0.0)));
            (one(&table).velocities[0], one(&table).headings[0].angle)
        };
        let near = |found: f32, wanted: f32| assert!((found - wanted).abs() < 1e-5, "{found} {wanted}");
        near(far(vec![fault("food_0", Kind::MotorGain, 0.5)]).0.x, 0.5);
        near(far(vec![fault("food_0", Kind::SpeedLimit, 0.3)]).0.x, 0.3);
        near(far(vec![fault("food_0", Kind::Unavailable, 1.0)]).0.norm(), 0.0);
        let (velocity, angle) = far(vec![fault("food_0", Kind::HeadingBias, PI / 2.0)]);
        near(velocity.y, 1.0);
        near(angle, 0.0);
        let mut table = alone(drive, Engine::Discs, vec![fault("food_0", Kind::MotorGain, 0.5)]);
        (0..6).for_each(|_| table.step(&action(drive, 0.0, 0.1)));
        let whole = if drive == DriveMode::Unicycle { 4.0 } else { 20.0 };
        near(one(&table).headings[0].turn_rate, 0.05 * whole);
    }
}

#[test]
fn starts_point_anywhere_and_move_nothing_else() {
    let plain = Scenario { robots: mixed_team(8), ..Scenario::default() };
    let wheeled = with_wheels(plain.clone());
    let plain = Scenario { rescue_radius_m: wheeled.rescue_radius_m, ..plain };
    let mut quarters = [0; 4];
    let tables = [plain, wheeled].map(|scenario| Table::new(scenario, options(200, 3)));
    for (plain, wheeled) in tables[0].batch.worlds().zip(tables[1].batch.worlds()) {
        assert_eq!((&plain.positions, &plain.victims), (&wheeled.positions, &wheeled.victims));
        assert!(plain.headings.is_empty());
        for (robot, heading) in wheeled.headings.iter().enumerate() {
            if robot % 4 == 3 {
                assert_eq!((heading.angle, heading.turn_rate), (0.0, 0.0), "it has none");
            } else {
                quarters
                    [((heading.angle + std::f32::consts::PI) / std::f32::consts::FRAC_PI_2) as usize % 4] +=
                    1;
                assert_eq!(heading.turn_rate, 0.0);
            }
        }
    }
    assert!(quarters.iter().all(|count| (count - 300_i32).abs() < 75), "{quarters:?}");
}

#[test]
fn columns_say_where_robots_point_and_where_victims_are_from_there() {
    let scenario = with_wheels(Scenario { robots: mixed_team(5), ..Scenario::default() });
    for (scenario, kind) in [
        (scenario.clone(), "plain"),
        (with_sight(scenario.clone()), "sight"),
        (Scenario { faults: coming_and_going(&scenario.robots), ..scenario.clone() }, "faults"),
        (with_leaving(scenario.clone()), "leaving"),
    ] {
        let mut table = Table::new(scenario, options(ENVS, 5));
        let names = table.batch.rules().layout.names();
        let at = |name: &str| names.iter().position(|one| one == name).expect(name);
        let (width, mut source, mut pointed, mut seen) = (names.len(), chance(5), 0, 0);
        for _ in 0..60 {
            step(&mut table, &mut source);
            let robots = table.batch.rules().team.len();
            for (env, world) in table.batch.worlds().enumerate() {
                for own in 0..robots {
                    let row = &table.obs[(env * robots + own) * width..][..width];
                    let value = |name: String| f64::from(row[at(&name)]);
                    let near = |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-5, "{kind}");
                    let ahead = ["x", "y"].map(|axis| value(format!("own.heading.{axis}")));
                    let held = ["faults", "leaving"].contains(&kind); // some repeat an older reading
                    if own % 4 == 3 {
                        assert_eq!(ahead, [0.0; 2]);
                    } else if !held {
                        let angle = f64::from(world.headings[own].angle);
                        near(ahead[0], angle.cos());
                        near(ahead[1], angle.sin());
                        near(value("own.turn_rate".into()), f64::from(world.headings[own].turn_rate));
                        pointed += 1;
                    }
                    for (mate, other) in (0..robots).filter(|other| *other != own).enumerate() {
                        let found = ["x", "y"].map(|axis| value(format!("teammate_{mate}.heading.{axis}")));
                        let angle = f64::from(world.headings[other].angle);
                        let known = other % 4 != 3 && !held;
                        if known && found != [0.0; 2] {
                            near(found[0], angle.cos());
                            near(found[1], angle.sin());
                            seen += 1;
                        } else if known {
                            assert_eq!(kind, "sight");
                        }
                    }
                    for slot in 0..2 {
                        let [x, y] =
                            ["x", "y"].map(|axis| value(format!("victim_{slot}.relative_position.{axis}")));
                        near(value(format!("victim_{slot}.ahead")), ahead[0] * x + ahead[1] * y);
                        near(value(format!("victim_{slot}.left")), ahead[0] * y - ahead[1] * x);
                    }
                }
            }
        }
        assert!(pointed + seen > 1000 || kind == "faults" || kind == "leaving", "{kind}: {pointed} {seen}");
    }
    let plain = Table::new(Scenario::default(), options(1, 0)).batch.rules().layout.names();
    assert!(!plain.iter().any(|name| name.contains("heading") || name.contains("ahead")));
}

#[test]
fn robots_that_leave_come_back_without_turning_and_layers_take_wheels() {
    let scenario = with_leaving(with_layers(Scenario { robots: mixed_team(12), ..Scenario::default() }));
    let mut scenario = with_wheels(scenario);
    scenario.robots[0].start_m = None;
    let mut table = Table::new(scenario, options(ENVS, 6));
    let (mut source, mut left) = (chance(6), 0);
    for _ in 0..120 {
        step(&mut table, &mut source);
        for world in table.batch.worlds() {
            let absent = world.absent(table.batch.rules());
            for robot in (0..12).filter(|robot| absent >> robot & 1 == 1) {
                assert_eq!((world.velocities[robot].norm(), world.headings[robot].turn_rate), (0.0, 0.0));
                left += 1;
            }
        }
    }
    assert!(left > 100, "{left}");
}

#[test]
fn headings_that_no_robot_has_are_refused() {
    let mut table = alone(DriveMode::Unicycle, Engine::Discs, vec![]);
    for (angles, said) in [
        ([4.0].as_slice(), "headings = 4 (env 0, robot 0): must be in -3.1415927..=3.1415927 rad"),
        (&[f32::NAN], "headings = NaN (env 0, robot 0): must be in -3.1415927..=3.1415927 rad"),
        (&[0.0, 0.0], "headings = 2 values: must be 1 numbers"),
    ] {
        let before = table.batch.snapshot();
        assert_eq!(table.batch.set_headings(angles).expect_err("refused").to_string(), said);
        assert_eq!(table.batch.snapshot(), before);
    }
    let mut plain = Table::new(Scenario::default(), options(1, 0));
    let error = plain.batch.set_headings(&[0.0; 4]).expect_err("no wheels").to_string();
    assert_eq!(error, "headings = 4 values: no robot of this scenario has a heading");
}
