//! What holds of any fault at any time.

use innerattn_env::fault::{Fault, HEALTHY, KINDS, Kind, NUM_KINDS};
use innerattn_env::robot::Commands;
use innerattn_env::scenario::{Robot, Scenario};
use proptest::prelude::*;

use super::STAY;
use crate::common::{Table, chance, coming_and_going, fault, options, random_drive};

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
