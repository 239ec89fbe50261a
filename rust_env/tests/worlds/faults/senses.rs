//! Faults of what a robot is shown.

use innerattn_env::fault::{Fault, Kind};

use super::{EAST, STAY, column, row, team};
use crate::common::{Table, chance, fault, options, random_drive};

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

/// `food_1` frozen in steps 3 to 6 and again in 9 to 11, while `medical_0` is never well.
#[test]
fn what_thaws_sees_again_whatever_else_is_wrong() {
    let frozen = |onset_step, duration_steps| Fault {
        onset_step,
        duration_steps: Some(duration_steps),
        ..fault("food_1", Kind::FrozenSensor, 1.0)
    };
    let faults = vec![fault("medical_0", Kind::MotorGain, 0.5), frozen(3, 4), frozen(9, 3)];
    let mut table = Table::new(team(faults.clone()), options(1, 4));
    let mut seeing = Table::new(team(faults[..1].to_vec()), options(1, 4));
    let (mut chance, mut held) = (chance(1), vec![]);
    for step in 1..=20 {
        let drives: Vec<[f32; 2]> = (0..4).map(|_| random_drive(&mut chance)).collect();
        table.step(&drives);
        seeing.step(&drives);
        if step == 3 || step == 9 {
            held = row(&seeing, 1);
        }
        let frozen = (3..7).contains(&step) || (9..12).contains(&step);
        assert_eq!(row(&table, 1), if frozen { held.clone() } else { row(&seeing, 1) }, "step {step}");
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
fn a_worse_fault_meets_the_same_chances() {
    let envs = 200;
    let tables = |kind, values: [f64; 2]| {
        values.map(|value| Table::new(team(vec![fault("food_0", kind, value)]), options(envs, 8)))
    };
    let mut healthy = Table::new(team(vec![]), options(envs, 8));
    let [mut few, mut many] = tables(Kind::Blackout, [0.3, 0.6]);
    let [mut small, mut large] = tables(Kind::PositionNoise, [0.1, 0.2]);
    let (x, y) = (column(&healthy, "own.position.x"), column(&healthy, "own.position.y"));
    let width = healthy.batch.rules().layout.width();
    let (mut both, mut more) = (0, 0);
    for _ in 0..20 {
        for table in [&mut healthy, &mut few, &mut many, &mut small, &mut large] {
            table.step(&vec![STAY; 4 * envs]);
        }
        for row in (0..envs).map(|env| 4 * env * width) {
            let dark = |table: &Table| table.obs[row + x] == 0.0 && table.obs[row + y] == 0.0;
            assert!(!dark(&few) || dark(&many));
            both += i32::from(dark(&few));
            more += i32::from(dark(&many));
            for column in [x, y] {
                let [one, other] =
                    [&small, &large].map(|table| table.obs[row + column] - healthy.obs[row + column]);
                assert!((2.0 * one - other).abs() < 1e-5, "{one} {other}");
            }
        }
    }
    assert!(900 < both && both < 1500 && 2100 < more && more < 2700, "{both} {more} of 4000");
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
