//! Victims that a caller moves or adds: they are rescued like any other, and what cannot be is refused.

use innerattn_env::scenario::{Scenario, Situation};
use proptest::prelude::*;

use crate::common::{Table, chance, coming_and_going, options, random_drive, with_areas, with_times};

const ENVS: usize = 3;

fn table(situation: Situation) -> Table {
    Table::new(Scenario { situation, ..Scenario::default() }, options(ENVS, 3))
}

/// What `set_victims` takes, read off the worlds: who is present, tasks and places.
fn victims(table: &Table) -> (Vec<bool>, Vec<i64>, Vec<f32>) {
    let victims: Vec<_> = table.batch.worlds().flat_map(|world| world.victims.clone()).collect();
    let tasks = victims.iter().map(|victim| victim.map_or(-1, |victim| i64::from(victim.task))).collect();
    let at = |victim: &Option<innerattn_env::tasks::Victim>| {
        victim.map_or([0.0; 2], |v| [v.position.x, v.position.y])
    };
    (victims.iter().map(Option::is_some).collect(), tasks, victims.iter().flat_map(at).collect())
}

fn slots(table: &Table) -> usize {
    table.batch.rules().scenario.num_victims()
}

#[test]
fn a_victim_put_beside_its_helpers_is_rescued_and_counts_like_any_other() {
    let mut table = table(Situation::Mixed);
    let slots = slots(&table);
    let still = [0.0; ENVS * 8];
    let row = [-0.05, 0.0, 0.5, 0.5, 0.0, 0.6, 0.05, 0.0]; // food_0 and medical_0 are near the centre
    table.batch.set_motion(&row.repeat(ENVS), &still).expect("places in the arena");
    let (mut present, mut tasks, mut places) = victims(&table);
    for env in 0..ENVS {
        let empty = (0..slots).find(|slot| !present[env * slots + slot]).unwrap_or(0);
        present[env * slots + empty] = true;
        tasks[env * slots + empty] = 0;
        places[2 * (env * slots + empty)..][..2].copy_from_slice(&[0.0, 0.0]);
    }
    let earlier: Vec<u32> = table.batch.worlds().map(|world| world.appeared).collect();
    let were: Vec<usize> = table.batch.worlds().map(|world| world.victims.iter().flatten().count()).collect();
    table.batch.set_victims(&present, &tasks, &places).expect("tasks and places that may be");
    for ((world, earlier), were) in table.batch.worlds().zip(earlier).zip(were) {
        let present = world.victims.iter().flatten().count();
        assert_eq!(world.appeared - earlier, (present - were) as u32);
    }
    table.step(&[[0.0; 2]; ENVS * 4]);
    let found: Vec<_> = table.rescues.iter().filter(|rescue| rescue.task == 0).collect();
    assert_eq!(found.iter().map(|rescue| rescue.env).collect::<Vec<_>>(), [0, 1, 2]);
    assert!(found.iter().all(|rescue| rescue.helpers[..2] == [Some(0), Some(3)]));
    assert!(table.batch.worlds().all(|world| world.rescued >= 1));
}

#[test]
fn what_cannot_be_is_named_and_nothing_changes() {
    let mut mixed = table(Situation::Mixed);
    let slots = slots(&mixed);
    let (present, tasks, places) = victims(&mixed);
    let there = present.iter().rposition(|present| *present).expect("a victim");
    let (env, slot) = (there / slots, there % slots);
    let mut refusal = |task: Option<i64>, x: f32, y: f32| {
        let (mut present, mut tasks, mut places) = (present.clone(), tasks.clone(), places.clone());
        present[there] = task.is_some();
        tasks[there] = task.unwrap_or(-1);
        places[2 * there..][..2].copy_from_slice(&[x, y]);
        // The first victim would have moved.
        places[0] = -places[0];
        let before = mixed.batch.snapshot();
        let error =
            mixed.batch.set_victims(&present, &tasks, &places).expect_err("what cannot be").to_string();
        assert!(mixed.batch.snapshot() == before, "something changed: {error}");
        error
    };
    let named = |field: &str, rest: &str| format!("victims[{field}, env {env}, slot {slot}] = {rest}");
    assert_eq!(
        refusal(None, 0.0, 0.0),
        named("present", "false: must be true: a victim leaves when it is rescued or lost")
    );
    assert_eq!(refusal(Some(2), 0.0, 0.0), named("task", "2: must be in 0..=1"));
    assert_eq!(refusal(Some(-1), 0.0, 0.0), named("task", "-1: must be in 0..=1"));
    assert_eq!(refusal(Some(0), 0.91, 0.0), named("x", "0.91: must be in -0.9..=0.9 m"));
    assert_eq!(refusal(Some(0), 0.0, f32::NAN), named("y", "NaN: must be in -0.9..=0.9 m"));
    let error = mixed.batch.set_victims(&present, &tasks[1..], &places).expect_err("too few").to_string();
    let wanted = ENVS * slots;
    assert_eq!(error, format!("victims = {} values: must be {wanted}", wanted - 1));

    let mut double = table(Situation::Double);
    let (present, mut tasks, places) = victims(&double);
    tasks.swap(2, 3);
    let error =
        double.batch.set_victims(&present, &tasks, &places).expect_err("the tasks' slots").to_string();
    assert_eq!(error, "victims[task, env 1, slot 0] = 1: must be in 0..=0");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever is put where at any time, outside of areas of tasks, too, the worlds stay worlds of their
    /// scenario: their image can be restored, and goes on bit for bit. Giving back what is there changes nothing.
    #[test]
    fn worlds_with_moved_victims_are_worlds(
        seed in 0..1000_u64, situation in 0..3_usize, faulty: bool, timed: bool, sites: bool, adds in 0..3_u32,
    ) {
        let situation = [Situation::Single, Situation::Double, Situation::Mixed][situation];
        let plain = Scenario { situation, ..Scenario::default() };
        let faults = if faulty { coming_and_going(&plain.robots) } else { vec![] };
        let scenario = Scenario { faults, ..plain };
        let scenario = if timed { with_times(scenario) } else { scenario };
        let scenario = if sites { with_areas(scenario) } else { scenario };
        let situation = scenario.situation;
        let mut table = Table::new(scenario.clone(), options(ENVS, seed));
        let (mut chance, slots) = (chance(seed), slots(&table));
        for _ in 0..40 {
            let drives: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
            table.step(&drives);
            let (mut present, mut tasks, mut places) = victims(&table);
            let before = table.batch.snapshot();
            table.batch.set_victims(&present, &tasks, &places).expect("what is there");
            prop_assert!(table.batch.snapshot() == before);
            for at in 0..ENVS * slots {
                if chance.below(4) == 0 && (present[at] || chance.below(3) < adds as usize) {
                    present[at] = true;
                    tasks[at] = if situation == Situation::Double { at % slots } else { chance.below(2) } as i64;
                    places[2 * at..][..2].copy_from_slice(&[chance.between(-0.9, 0.9), chance.between(-0.9, 0.9)]);
                }
            }
            table.batch.set_victims(&present, &tasks, &places).expect("tasks and places that may be");
            prop_assert!(victims(&table) == (present, tasks, places));
        }
        let image = table.batch.snapshot();
        let mut other = Table::new(scenario, options(ENVS, seed + 1));
        other.batch.restore(&image).expect("a state that the scenario allows");
        for _ in 0..20 {
            let drives: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
            table.step(&drives);
            other.step(&drives);
            prop_assert!(table.shown(0, ENVS) == other.shown(0, ENVS));
        }
    }
}
