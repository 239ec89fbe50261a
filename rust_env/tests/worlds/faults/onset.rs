//! When faults begin and end, of themselves and by the caller's hand.

use innerattn_env::batch::Autoreset;
use innerattn_env::error::Error;
use innerattn_env::fault::{Fault, HEALTHY, Kind, NUM_KINDS};
use innerattn_env::scenario::Scenario;

use super::{EAST, STAY, alone, team};
use crate::common::{Table, fault, options};

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
        seen.push(world.faults.levels(0)[Kind::MotorGain as usize]);
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
    let mut lengths = vec![0_u32; envs];
    for step in 0..99 {
        let now: Vec<bool> = table.batch.worlds().map(|world| world.faults.unavailable() == 1).collect();
        for ((before, now), length) in before.iter().zip(&now).zip(&mut lengths) {
            assert!(step >= 10 || !now);
            assert!(*now || [0, 5].contains(length), "it lasted {length} steps");
            *length = if *now { *length + 1 } else { 0 };
            assert!(*length <= 5, "it came again without a healthy step between");
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
        world.faults.levels(0)[Kind::MotorGain as usize]
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
