//! A world's bytes depend on its scenario, seed, stream and actions: not on threads, on the batch's
//! size or on what the neighbours do.

use innerattn_env::batch::Options;
use innerattn_env::scenario::{Actions, Scenario, Shaping, Situation};

use crate::common::{
    ENGINES, Table, chance, coming_and_going, mixed_team, options, random_drive, some_obstacles,
    with_amounts, with_an_end, with_areas, with_arrivals, with_batteries, with_layers, with_leaving,
    with_list, with_loads, with_map, with_order, with_radio, with_rays, with_sight, with_times, with_wheels,
};

const STEPS: usize = 150;

/// Small arenas, so that most steps have contacts, in every situation and both kinds of actions, with
/// and without faults.
fn scenarios() -> Vec<Scenario> {
    let tight = Scenario { arena_half_width_m: 0.6, spawn_clearance_m: 0.1, ..Scenario::default() };
    let tight = Scenario { contact_cost: 0.1, ..tight };
    let scenarios = [
        tight.clone(),
        Scenario {
            situation: Situation::Double,
            actions: Actions::Continuous,
            obstacles: some_obstacles(),
            contact_cost: 0.1,
            ..Scenario::default()
        },
        Scenario { faults: coming_and_going(&tight.robots), observe_faults: true, ..tight.clone() },
        Scenario {
            situation: Situation::Single,
            robots: mixed_team(12),
            shaping: Shaping::Potential,
            end_when_rescued: Some(2),
            ..tight.clone()
        },
        with_amounts(tight.clone()),
        with_order(tight.clone()),
        with_areas(tight.clone()),
        with_arrivals(tight.clone()),
        with_list(tight.clone()),
        with_an_end(tight.clone()),
        with_leaving(tight.clone()),
        with_batteries(with_leaving(tight.clone())),
        with_batteries(tight.clone()),
        with_loads(with_leaving(tight.clone())),
        with_loads(with_batteries(tight.clone())),
        with_layers(with_leaving(Scenario { robots: mixed_team(12), ..tight.clone() })),
        with_sight(with_layers(Scenario {
            obstacles: some_obstacles(),
            contact_cost: 0.1,
            ..Scenario::default()
        })),
        with_sight(Scenario { faults: coming_and_going(&tight.robots), ..tight.clone() }),
        with_map(with_sight(with_layers(tight.clone()))),
        with_rays(with_wheels(with_layers(tight.clone()))),
        with_radio(Scenario { faults: coming_and_going(&tight.robots), ..tight.clone() }),
        with_wheels(with_leaving(Scenario { robots: mixed_team(12), ..tight.clone() })),
        with_wheels(Scenario {
            actions: Actions::Continuous,
            faults: coming_and_going(&tight.robots),
            ..tight.clone()
        }),
        with_times(tight),
    ];
    let by = |engine| scenarios.clone().map(|scenario| Scenario { engine, ..scenario });
    ENGINES.into_iter().flat_map(by).collect()
}

/// Actions of every step, one row of robots for each env.
fn actions(seed: u64, envs: usize, robots: usize) -> Vec<Vec<[f32; 2]>> {
    let mut chance = chance(seed);
    (0..STEPS).map(|_| (0..envs * robots).map(|_| random_drive(&mut chance)).collect()).collect()
}

#[test]
fn threads_change_nothing() {
    for scenario in scenarios() {
        let actions = actions(1, 100, scenario.robots.len());
        let mut tables = [1, 2, 3].map(|threads| {
            Table::new(scenario.clone(), Options { num_threads: Some(threads), ..options(100, 5) })
        });
        for actions in &actions {
            let shown = tables.each_mut().map(|table| {
                table.step(actions);
                table.shown(0, 100)
            });
            assert!(shown[0] == shown[1] && shown[0] == shown[2]);
        }
        let images = tables.map(|table| table.batch.snapshot());
        assert!(images[0] == images[1] && images[0] == images[2]);
    }
}

#[test]
fn a_world_alone_is_the_same_world_in_a_batch() {
    for scenario in scenarios() {
        let robots = scenario.robots.len();
        let actions = actions(2, 100, robots);
        let mut whole = Table::new(scenario.clone(), Options { num_threads: Some(2), ..options(100, 9) });
        let parts = [(0, 1), (41, 42), (99, 100), (20, 27)];
        let mut tables = parts.map(|(from, to)| {
            let options = Options { first_env: from as u64, ..options(to - from, 9) };
            Table::new(scenario.clone(), options)
        });
        let mut touched = false;
        for actions in &actions {
            whole.step(actions);
            touched |= (0..100 * robots).any(|row| whole.touched(row));
            for ((from, to), table) in parts.into_iter().zip(&mut tables) {
                table.step(&actions[from * robots..to * robots]);
                assert!(table.shown(0, to - from) == whole.shown(from, to), "worlds {from}..{to}");
            }
        }
        assert!(touched, "a test without contacts proves little");
    }
}

#[test]
fn neighbours_change_nothing() {
    for scenario in scenarios() {
        let robots = scenario.robots.len();
        let [calm, wild] = [3, 4].map(|seed| actions(seed, 8, robots));
        let mut tables = [(); 2].map(|()| Table::new(scenario.clone(), options(8, 0)));
        let mut differed = false;
        for (calm, wild) in calm.iter().zip(&wild) {
            let mut other = wild.clone();
            other[5 * robots..6 * robots].copy_from_slice(&calm[5 * robots..6 * robots]);
            tables[0].step(calm);
            tables[1].step(&other);
            assert!(tables[0].shown(5, 6) == tables[1].shown(5, 6));
            differed |= tables[0].shown(4, 5) != tables[1].shown(4, 5);
        }
        assert!(differed, "the neighbours did the same");
    }
}

#[test]
fn an_episode_does_not_depend_on_the_one_before() {
    scenarios().into_iter().filter(|scenario| scenario.robots.len() == 4).for_each(begins_the_same);
}

fn begins_the_same(scenario: Scenario) {
    let scenario = Scenario { end_when_rescued: Some(1), ..scenario };
    let mut tables = [(); 2].map(|()| Table::new(scenario.clone(), options(4, 3)));
    for (table, seed) in tables.iter_mut().zip([6, 7]) {
        actions(seed, 4, 4).iter().take(10).for_each(|actions| table.step(actions));
        for world in 0..4 {
            // Early endings lead on to later episodes; go to episode 20 in each.
            while table.batch.worlds().nth(world).is_some_and(|world| world.episode < 20) {
                let mask: Vec<bool> = (0..4).map(|index| index == world).collect();
                table.batch.reset(None, Some(&mask), &mut table.obs);
            }
        }
    }
    assert!(tables[0].batch.snapshot() == tables[1].batch.snapshot());
    assert!(tables[0].obs == tables[1].obs);
}
