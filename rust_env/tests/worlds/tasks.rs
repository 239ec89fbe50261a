//! Victims that take time: what holds of services and deadlines whatever the robots do.

use std::collections::HashSet;

use innerattn_env::reward::{COMPONENTS, NUM_COMPONENTS};
use innerattn_env::scenario::{Deadline, Interrupted, Scenario, Situation};
use innerattn_env::tasks::Victim;
use proptest::prelude::*;

use crate::common::{Table, chance, options, random_drive};

const ENVS: usize = 4;
const STEPS: usize = 80;
const SITUATIONS: [Situation; 3] = [Situation::Single, Situation::Double, Situation::Mixed];

/// Wide rescue radii, so that needs are met now and then by chance.
fn scenario(
    situation: Situation,
    service_s: f64,
    service: Interrupted,
    deadline: Option<Deadline>,
) -> Scenario {
    let mut scenario = Scenario {
        situation,
        rescue_radius_m: 0.6,
        spawn_clearance_m: 0.1,
        lost_cost: 0.5,
        ..Scenario::default()
    };
    for task in &mut scenario.tasks {
        (task.service_s, task.service, task.deadline_s) = (service_s, service, deadline);
    }
    scenario
}

fn step(table: &mut Table, chance: &mut innerattn_env::rng::Stream) {
    let drives: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(chance)).collect();
    table.step(&drives);
}

fn played(scenario: &Scenario, seed: u64) -> Vec<Vec<u32>> {
    let (mut table, mut chance) = (Table::new(scenario.clone(), options(ENVS, seed)), chance(seed));
    (0..STEPS)
        .map(|_| {
            step(&mut table, &mut chance);
            table.shown(0, ENVS)
        })
        .collect()
}

/// Whether distinct able robots are in the radius of the victim, by trying all.
fn is_met(table: &Table, env: usize, victim: &Victim) -> bool {
    let (rules, world) = (table.batch.rules(), table.batch.worlds().nth(env).expect("a world"));
    let radius = rules.scenario.rescue_radius_m as f32;
    let near = |robot: &usize| (world.positions[*robot] - victim.position).norm_squared() <= radius * radius;
    let robots: Vec<usize> = (0..4).filter(near).collect();
    let [one, other] = rules.tasks[victim.task as usize].abilities() else { panic!("two needs") };
    let can = |robot: usize, need: u32| rules.team[robot].abilities >> need & 1 == 1;
    robots.iter().any(|a| robots.iter().any(|b| a != b && can(*a, *one) && can(*b, *other)))
}

/// The victims of a world with their slots.
fn victims(table: &Table, env: usize) -> Vec<(usize, Victim)> {
    let world = table.batch.worlds().nth(env).expect("a world");
    world
        .victims
        .iter()
        .enumerate()
        .filter_map(|(slot, victim)| victim.map(|victim| (slot, victim)))
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Every step of every victim against the rule: served, rescued, lost, or left alone.
    #[test]
    fn victims_are_served_rescued_and_lost_by_the_rule(
        seed in 0..10_000_u64, situation in 0..3_usize, steps in 0..6_u32, restarts: bool,
        (least, more) in (6..14_u32, 0..12_u32),
    ) {
        let kind = if restarts { Interrupted::Restart } else { Interrupted::Keep };
        let [low, high] = [least, least + more].map(|steps| f64::from(steps) * 0.1);
        let scenario =
            scenario(SITUATIONS[situation], f64::from(steps) * 0.1, kind, Some(Deadline::Between([low, high])));
        let (mut table, mut chance) = (Table::new(scenario, options(ENVS, seed)), chance(seed));
        let mut gone = HashSet::new();
        for _ in 0..STEPS {
            let before: Vec<_> = (0..ENVS).map(|env| victims(&table, env)).collect();
            let worlds: Vec<(u64, u32)> =
                table.batch.worlds().map(|world| (world.episode, world.step)).collect();
            step(&mut table, &mut chance);
            for env in 0..ENVS {
                let (episode, now) = worlds[env];
                let ended = table.terminated[env] || table.truncated[env];
                let after = victims(&table, env);
                for (slot, victim) in &before[env] {
                    let is_it = |of: (u32, u32, u32)| of == (env as u32, *slot as u32, victim.id);
                    let rescued = table.rescues.iter().any(|one| is_it((one.env, one.slot, one.victim)));
                    let lost = table.losses.iter().any(|one| is_it((one.env, one.slot, one.victim)));
                    let due = victim.deadline_step <= now + 1;
                    prop_assert!((6..=26).contains(&(victim.deadline_step - victim.appeared_step)));
                    prop_assert!(victim.deadline_step > now, "a victim outlived its deadline");
                    prop_assert!(!(rescued && lost));
                    prop_assert_eq!(lost, due && !rescued);
                    if rescued || lost {
                        prop_assert!(gone.insert((env, episode, victim.id)), "gone twice");
                    }
                    if rescued {
                        // Served in as many steps as the service takes, this one among them.
                        prop_assert_eq!(victim.served_steps + 1, steps.max(1));
                    }
                    if ended {
                        continue; // the next episode has begun
                    }
                    let met = is_met(&table, env, victim);
                    let there = after.iter().find(|(at, other)| (at, other.id) == (slot, victim.id));
                    prop_assert_eq!(there.is_none(), rescued || lost);
                    prop_assert!(!rescued || met);
                    let Some((_, later)) = there else { continue };
                    prop_assert_eq!(later.deadline_step, victim.deadline_step);
                    let alone = before[env].len() == 1; // others may keep the robots busy
                    if later.served_steps > victim.served_steps {
                        prop_assert!(met);
                        prop_assert_eq!(later.served_steps, victim.served_steps + 1);
                    } else {
                        prop_assert!(!met || !alone);
                        prop_assert_eq!(later.served_steps, if restarts { 0 } else { victim.served_steps });
                    }
                }
                let cost = -0.5 * table.losses.iter().filter(|loss| loss.env as usize == env).count() as f32;
                let column = COMPONENTS.iter().position(|one| one.name == "lost").expect("a component");
                for robot in env * 4..env * 4 + 4 {
                    let paid = table.components[robot * NUM_COMPONENTS + column];
                    prop_assert!((paid - cost).abs() < 1e-6);
                }
            }
        }
    }

    /// A service of no time is none, whatever an interruption would do to it.
    #[test]
    fn a_service_of_no_time_is_none(seed in 0..10_000_u64, situation in 0..3_usize) {
        let [keep, restart] = [Interrupted::Keep, Interrupted::Restart];
        let plain = scenario(SITUATIONS[situation], 0.0, keep, None);
        prop_assert!(played(&plain, seed) == played(&scenario(SITUATIONS[situation], 0.0, restart, None), seed));
    }

    /// A deadline that never comes adds a column of ones, or nearly, and changes nothing else. Nor does how it
    /// is drawn.
    #[test]
    fn a_deadline_that_never_comes_is_none(seed in 0..10_000_u64, situation in 0..3_usize, drawn: bool) {
        let deadline = if drawn { Deadline::Between([9e5, 1e6]) } else { Deadline::Same(1e6) };
        let with = |deadline| scenario(SITUATIONS[situation], 0.2, Interrupted::Keep, deadline);
        let mut tables = [None, Some(deadline)].map(|deadline| Table::new(with(deadline), options(ENVS, seed)));
        let mut chances = [chance(seed), chance(seed)];
        let names = tables[1].batch.rules().layout.names();
        for _ in 0..STEPS {
            tables.iter_mut().zip(&mut chances).for_each(|(table, chance)| step(table, chance));
            let [plain, timed] = &tables;
            prop_assert!(plain.rescues == timed.rescues && timed.losses.is_empty());
            prop_assert!(plain.reward == timed.reward && plain.truncated == timed.truncated);
            let mut kept = vec![];
            for row in timed.obs.chunks_exact(names.len()) {
                for (name, value) in names.iter().zip(row) {
                    if name.ends_with(".time_left") {
                        prop_assert!(*value == 0.0 || (0.89..=1.0).contains(value));
                    } else {
                        kept.push(*value);
                    }
                }
            }
            prop_assert!(kept == plain.obs);
        }
    }
}

#[test]
fn a_rescue_at_the_very_step_of_the_deadline_counts() {
    for (deadline, rescued) in [(0.3, true), (0.4, true), (0.2, false)] {
        let mut single = scenario(Situation::Single, 0.3, Interrupted::Keep, Some(Deadline::Same(deadline)));
        if !rescued {
            single.tasks.iter_mut().for_each(|task| task.service_s = 0.2);
        }
        single.rescue_radius_m = 2.9; // all are near from the first step on
        if !rescued {
            single.rescue_radius_m = 0.12;
            single.victim_places_m = vec![[0.8, 0.8]];
            single.robots.iter_mut().enumerate().for_each(|(index, robot)| {
                robot.start_m = Some([-0.8, 0.2 * index as f64]);
            });
        }
        let mut table = Table::new(single, options(1, 1));
        let mut steps = vec![];
        for now in 0..4 {
            table.step(&[[0.0; 2]; 4]);
            steps.extend(table.rescues.iter().map(|_| (now, "rescued")));
            steps.extend(table.losses.iter().map(|_| (now, "lost")));
        }
        let wanted: &[(i32, &str)] = if rescued { &[(2, "rescued")] } else { &[(1, "lost"), (3, "lost")] };
        assert_eq!(steps, wanted, "deadline {deadline} s");
    }
}

#[test]
fn robots_see_how_far_a_service_is_and_what_time_is_left() {
    let mut single = scenario(Situation::Single, 0.4, Interrupted::Keep, Some(Deadline::Same(1.0)));
    single.rescue_radius_m = 2.9;
    let mut table = Table::new(single, options(1, 1));
    let names = table.batch.rules().layout.names();
    assert_eq!(names[names.len() - 2..], ["victim_0.served", "victim_0.time_left"]);
    for (served, left) in [(0.0, 1.0), (0.25, 0.9), (0.5, 0.8), (0.75, 0.7), (0.0, 1.0)] {
        for row in table.obs.chunks_exact(names.len()) {
            assert!((row[names.len() - 2] - served).abs() < 1e-6, "{served}: {:?}", &row[names.len() - 2..]);
            assert!((row[names.len() - 1] - left).abs() < 1e-6, "{left}: {:?}", &row[names.len() - 2..]);
        }
        table.step(&[[0.0; 2]; 4]);
    }
}
