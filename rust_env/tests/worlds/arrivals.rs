//! Victims that arrive at random or from a list: how many, in which slots, and that nothing the robots do moves them.

use std::iter::zip;

use innerattn_env::scenario::{Arrival, Scenario, Situation};
use innerattn_env::tasks::Victim;
use proptest::prelude::*;

use crate::common::{Table, chance, options, random_drive, with_an_end, with_arrivals, with_times};

const STILL: [f32; 2] = [0.0, 0.0];

/// Two tasks with these rates, 1/s, whose victims nobody rescues.
fn hopeless(rates: [f64; 2], max_victims: usize) -> Scenario {
    let mut scenario = Scenario { situation: Situation::Poisson, max_victims, ..Scenario::default() };
    for (task, rate) in zip(&mut scenario.tasks, rates) {
        task.arrival_rate_hz = rate;
    }
    Scenario { rescue_radius_m: 0.05, spawn_clearance_m: 0.3, episode_steps: 50, ..scenario }
}

/// Victims that arrived in each world's step, whether or not they found a slot.
fn arrived(table: &Table, earlier: &[u32]) -> Vec<usize> {
    let turned_away = |env: usize| table.turned_away.iter().filter(|one| **one as usize == env).count();
    let worlds = zip(table.batch.worlds(), earlier).enumerate();
    worlds.map(|(env, (world, earlier))| (world.appeared - earlier) as usize + turned_away(env)).collect()
}

fn appeared(table: &Table) -> Vec<u32> {
    table.batch.worlds().map(|world| world.appeared).collect()
}

#[test]
fn the_number_of_arrivals_in_a_time_is_poisson() {
    let envs = 2000;
    let mut table = Table::new(hopeless([0.4, 0.15], 2), options(envs, 7));
    let mut counts = vec![0; envs];
    for _ in 0..49 {
        let earlier = appeared(&table);
        table.step(&vec![STILL; envs * 4]);
        zip(&mut counts, arrived(&table, &earlier)).for_each(|(count, one)| *count += one);
    }
    let expected = 0.55 * 4.9;
    let mut chance = f64::exp(-expected);
    let (mut chi_squared, mut rest) = (0.0, 1.0);
    for number in 0..7 {
        let found = counts.iter().filter(|count| **count == number).count() as f64;
        let wanted = envs as f64 * chance;
        chi_squared += (found - wanted).powi(2) / wanted;
        rest -= chance;
        chance *= expected / (number + 1) as f64;
    }
    let found = counts.iter().filter(|count| **count >= 7).count() as f64;
    chi_squared += (found - envs as f64 * rest).powi(2) / (envs as f64 * rest);
    assert!(chi_squared < 24.3, "{chi_squared}: seven degrees of freedom go beyond it once in a thousand");
    let held = table.batch.worlds().all(|world| (0..2).all(|task| of_task(&world.victims, task) <= 2));
    assert!(held && !table.turned_away.is_empty());
}

fn of_task(victims: &[Option<Victim>], task: u32) -> usize {
    victims.iter().flatten().filter(|victim| victim.task == task).count()
}

#[test]
fn nothing_arrives_at_a_rate_of_nought() {
    let mut table = Table::new(hopeless([0.0, 0.0], 3), options(3, 1));
    let width = table.batch.rules().layout.width();
    let victims = 6 * 6; // columns: presence, three needs, two of the place
    for _ in 0..120 {
        table.step(&[[1.0, 0.0]; 12]);
        assert!(table.batch.worlds().all(|world| world.victims == [None; 6] && world.appeared == 0));
        assert!(table.obs.chunks(width).all(|row| row[width - victims..].iter().all(|one| *one == 0.0)));
        assert!(table.reward.iter().all(|reward| *reward == 0.0) && table.turned_away.is_empty());
    }
}

fn arrival(at_s: f64, task: &str, position_m: [f64; 2]) -> Arrival {
    Arrival { at_s, task: task.into(), position_m }
}

#[test]
fn a_list_arrives_step_by_step_where_it_says() {
    let arrivals = vec![
        arrival(0.5, "task_2", [0.75, -0.5]),
        arrival(0.0, "task_1", [0.5, 0.25]),
        arrival(0.42, "task_2", [0.9, 0.9]),
        arrival(0.8, "task_2", [-0.25, 0.5]),
        arrival(99.0, "task_1", [0.0, 0.0]),
    ];
    let scenario = Scenario {
        situation: Situation::Listed,
        arrivals,
        rescue_radius_m: 0.05,
        episode_steps: 10,
        ..Scenario::default()
    };
    let mut table = Table::new(scenario, options(2, 3));
    for _ in 0..3 {
        for step in 0..10 {
            let wanted = [
                Some((0, 0, 0, [0.5, 0.25])),
                None,
                Some((1, 1, 5, [0.75, -0.5])).filter(|_| step >= 5),
                Some((2, 1, 5, [0.9, 0.9])).filter(|_| step >= 5),
            ];
            for world in table.batch.worlds() {
                let seen =
                    |one: &Victim| (one.id, one.task, one.appeared_step, [one.position.x, one.position.y]);
                let found: Vec<_> = world.victims.iter().map(|one| one.as_ref().map(seen)).collect();
                assert_eq!((world.step, found.as_slice()), (step, wanted.as_slice()));
            }
            table.step(&[STILL; 8]);
            let turned_away: &[u32] = if step == 7 { &[0, 1] } else { &[] };
            assert_eq!(table.turned_away, turned_away, "with the end of step {step}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whoever is there stays as it is; who is new is in a slot of its task that was empty; who is turned away
    /// finds all of them taken; and as many arrive as where the robots do something else.
    #[test]
    fn arrivals_take_empty_slots_of_their_task(seed in 0..10_000_u64, max_victims in 1..5_usize, timed: bool) {
        const ENVS: usize = 4;
        let mut scenario = with_arrivals(Scenario { max_victims, ..Scenario::default() });
        if timed {
            scenario = with_times(scenario);
        }
        let mut table = Table::new(scenario.clone(), options(ENVS, seed));
        let mut other = Table::new(scenario, options(ENVS, seed));
        let mut chance = chance(seed);
        for _ in 0..60 {
            let before: Vec<_> = table.batch.worlds().map(|world| world.victims.clone()).collect();
            let earlier = [appeared(&table), appeared(&other)];
            table.step(&(0..ENVS * 4).map(|_| random_drive(&mut chance)).collect::<Vec<_>>());
            other.step(&[STILL; ENVS * 4]);
            if table.truncated[0] {
                prop_assert!(table.batch.worlds().all(|world| world.victims.iter().all(Option::is_none)));
                continue;
            }
            prop_assert_eq!(arrived(&table, &earlier[0]), arrived(&other, &earlier[1]));
            for (env, (world, victims)) in zip(table.batch.worlds(), &before).enumerate() {
                let gone = |slot: usize| {
                    table.rescues.iter().any(|one| (one.env as usize, one.slot as usize) == (env, slot))
                        || table.losses.iter().any(|one| (one.env as usize, one.slot as usize) == (env, slot))
                };
                for (slot, (old, new)) in zip(victims, &world.victims).enumerate() {
                    let stays = old.filter(|_| !gone(slot));
                    match (stays, new) {
                        (Some(old), new) => {
                            let new = new.expect("it stays");
                            prop_assert_eq!((old.id, old.task, old.position), (new.id, new.task, new.position));
                        }
                        (None, Some(new)) => {
                            prop_assert_eq!(new.task as usize, slot / max_victims);
                            prop_assert_eq!(new.appeared_step, world.step);
                            prop_assert!(new.id >= earlier[0][env]);
                        }
                        (None, None) => {}
                    }
                }
                if table.turned_away.contains(&(env as u32)) {
                    prop_assert!((0..2).any(|task| of_task(&world.victims, task) == max_victims));
                }
            }
        }
    }

    /// An episode ends with the first step after which each of the list was rescued, lost or turned away.
    #[test]
    fn an_episode_ends_when_all_is_done(seed in 0..10_000_u64, goal in 0..12_u32, slots in 1..4_usize) {
        let end_when_rescued = (goal > 0).then_some(goal);
        let half = Scenario { arena_half_width_m: 0.7, max_victims: slots, ..Scenario::default() };
        let scenario = Scenario { end_when_rescued, ..with_an_end(half) };
        let (number, steps) = (scenario.arrivals.len(), scenario.episode_steps);
        let mut table = Table::new(scenario, options(4, seed));
        let (mut gone, mut chance) = ([0; 4], chance(seed));
        for _ in 0..120 {
            let before: Vec<_> = table.batch.worlds().map(|world| (world.step, world.rescued)).collect();
            table.step(&(0..16).map(|_| random_drive(&mut chance)).collect::<Vec<_>>());
            for (env, (step, rescued)) in before.into_iter().enumerate() {
                let of = |one: u32| usize::from(one as usize == env);
                let rescues: usize = table.rescues.iter().map(|one| of(one.env)).sum();
                let losses: usize = table.losses.iter().map(|one| of(one.env)).sum();
                let turned_away: usize = table.turned_away.iter().map(|one| of(*one)).sum();
                gone[env] += rescues + losses + turned_away;
                let enough = end_when_rescued.is_some_and(|goal| rescued + rescues as u32 >= goal);
                prop_assert_eq!(table.terminated[env], enough || gone[env] == number);
                prop_assert_eq!(table.truncated[env], step + 1 == steps);
                if table.terminated[env] || table.truncated[env] {
                    gone[env] = 0;
                }
            }
        }
    }
}

#[test]
fn an_empty_list_is_done_after_one_step() {
    let situation = Situation::Listed;
    let mut table =
        Table::new(Scenario { situation, end_when_done: true, ..Scenario::default() }, options(2, 1));
    table.step(&[STILL; 8]);
    assert_eq!(table.terminated, [true; 2]);
}
