//! The order of tasks: what holds of victims that wait for others, whatever the robots do.

use std::iter::zip;

use innerattn_env::scenario::{Interrupted, Scenario, Situation, Task};
use innerattn_env::tasks::Victim;
use proptest::prelude::*;

use crate::common::{Table, chance, options, random_drive};

const ENVS: usize = 4;
const STEPS: usize = 80;
const SITUATIONS: [Situation; 3] = [Situation::Single, Situation::Double, Situation::Mixed];

/// Three tasks of which one robot each does the work: a chain, or one task that waits for two. All robots
/// reach everything, so that only the order keeps them from rescuing.
fn scenario(situation: Situation, chain: bool, service_s: f64, service: Interrupted) -> Scenario {
    let task = |name: &str, need: &str, after: &[&str]| Task {
        after: after.iter().map(ToString::to_string).collect(),
        service_s,
        service,
        ..Task::new(name, vec![need.to_string()])
    };
    let last: &[&str] = if chain { &["second"] } else { &["first", "second"] };
    let tasks = vec![
        task("last", "food", last),
        task("first", "medicine", &[]),
        task("second", "information", if chain { &["first"] } else { &[] }),
    ];
    Scenario {
        situation,
        tasks,
        max_victims: 6,
        rescue_radius_m: 3.0,
        spawn_clearance_m: 0.05,
        ..Scenario::default()
    }
}

/// Whether a victim waits, by the rule, from names.
fn waits(scenario: &Scenario, victim: &Victim, all: &[Option<Victim>]) -> bool {
    let name = |victim: &Victim| &scenario.tasks[victim.task as usize].name;
    let after = &scenario.tasks[victim.task as usize].after;
    let before = |other: &Victim| after.contains(name(other)) && other.appeared_step <= victim.appeared_step;
    all.iter().flatten().any(before)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Nobody is served or rescued while it waits; who does not wait is, and what is seen says who waits.
    #[test]
    fn victims_wait_for_those_before_them(
        seed in 0..10_000_u64, situation in 0..3_usize, chain: bool, steps in 0..4_u32, restarts: bool,
    ) {
        let kind = if restarts { Interrupted::Restart } else { Interrupted::Keep };
        let scenario = scenario(SITUATIONS[situation], chain, f64::from(steps) * 0.1, kind);
        let (mut table, mut chance) = (Table::new(scenario.clone(), options(ENVS, seed)), chance(seed));
        let names = table.batch.rules().layout.names();
        let columns = |ending: &str| -> Vec<usize> {
            (0..names.len()).filter(|column| names[*column].ends_with(ending)).collect()
        };
        let (blocked, present) = (columns(".blocked"), columns(".present"));
        for _ in 0..STEPS {
            let before: Vec<_> = table.batch.worlds().map(|world| world.victims.clone()).collect();
            for (row, victims) in zip(table.obs.chunks_exact(4 * names.len()), &before) {
                let waiting =
                    victims.iter().flatten().filter(|victim| waits(&scenario, victim, victims)).count();
                for row in row.chunks_exact(names.len()) {
                    let told: f32 = blocked.iter().map(|column| row[*column]).sum();
                    prop_assert!((told - waiting as f32).abs() < 1e-6);
                    prop_assert!(zip(&blocked, &present).all(|(one, there)| row[*one] <= row[*there]));
                }
            }
            let drives: Vec<[f32; 2]> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
            table.step(&drives);
            for (env, victims) in before.iter().enumerate() {
                let ended = table.terminated[env] || table.truncated[env];
                let after = table.batch.worlds().nth(env).expect("a world").victims.clone();
                let mut busy = vec![];
                for (slot, victim) in victims.iter().enumerate() {
                    let Some(victim) = victim else { continue };
                    let is_it = |one: &&innerattn_env::tasks::Rescue| {
                        one.env as usize == env && one.slot as usize == slot
                    };
                    let rescued = table.rescues.iter().any(|one| is_it(&one));
                    let waits = waits(&scenario, victim, victims);
                    // Food has two robots, the other needs one each.
                    let robots = if scenario.tasks[victim.task as usize].name == "last" { 2 } else { 1 };
                    let is_free = busy.iter().filter(|task| **task == victim.task).count() < robots;
                    let served = !waits && is_free;
                    if served {
                        busy.push(victim.task);
                    }
                    prop_assert_eq!(rescued, served && victim.served_steps + 1 >= steps);
                    if ended || rescued {
                        continue;
                    }
                    let later = after[slot].expect("it stays");
                    let kept = if restarts { 0 } else { victim.served_steps };
                    prop_assert_eq!(later.id, victim.id);
                    prop_assert_eq!(later.served_steps, if served { victim.served_steps + 1 } else { kept });
                }
            }
        }
    }

    /// With one victim at a time nobody waits: an order adds a column of zeros, and changes nothing else.
    #[test]
    fn one_victim_at_a_time_never_waits(seed in 0..10_000_u64, chain: bool) {
        let ordered = scenario(Situation::Single, chain, 0.2, Interrupted::Keep);
        let mut plain = ordered.clone();
        plain.tasks.iter_mut().for_each(|task| task.after.clear());
        let mut tables = [plain, ordered].map(|scenario| Table::new(scenario, options(ENVS, seed)));
        let mut chances = [chance(seed), chance(seed)];
        let names = tables[1].batch.rules().layout.names();
        let width = names.len();
        prop_assert_eq!(names[width - 1].as_str(), "victim_0.blocked");
        for _ in 0..STEPS {
            for (table, chance) in zip(&mut tables, &mut chances) {
                table.step(&(0..ENVS * 4).map(|_| random_drive(chance)).collect::<Vec<_>>());
            }
            let [plain, ordered] = &tables;
            prop_assert!(plain.rescues == ordered.rescues && plain.reward == ordered.reward);
            let rows = zip(plain.obs.chunks_exact(width - 1), ordered.obs.chunks_exact(width));
            for (short, long) in rows {
                prop_assert!(long[..width - 1] == *short && long[width - 1].to_bits() == 0);
            }
        }
    }
}
