//! Faults of driving and helping.

use innerattn_env::fault::{Fault, Kind};
use innerattn_env::geometry::Vec2;
use innerattn_env::scenario::Scenario;

use super::{EAST, STAY, alone, column, place, row, team};
use crate::common::{ENGINES, Table, fault, options};

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
