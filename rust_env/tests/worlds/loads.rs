//! Loads: what holds of them and of robots without supplies, whatever the robots do.

use std::iter::zip;

use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Depot, Engine, Obstacle, Scenario, Shape, Shaping};
use innerattn_env::tasks::Rescue;
use proptest::prelude::*;

use crate::common::{
    ENGINES, Table, chance, coming_and_going, options, random_drive, with_amounts, with_batteries,
    with_leaving, with_loads, with_times,
};

const ENVS: usize = 3;
const STEPS: usize = 60;

fn tight(engine: Engine) -> Scenario {
    let shaping = Shaping::Progress;
    Scenario { engine, shaping, arena_half_width_m: 0.7, spawn_clearance_m: 0.1, ..Scenario::default() }
}

/// How far a depot is inside its radius, m; negative outside.
fn depth(one: &Depot, at: [f32; 2]) -> f64 {
    let [x, y] = at.map(f64::from);
    one.radius_m - (one.position_m[0] - x).hypot(one.position_m[1] - y)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Loads are what rescues and depots make them; who has none does not help; all see it.
    #[test]
    fn loads_are_accounted_for(seed in 0..10_000_u64, engine in 0..2_usize, more in 0..5_usize) {
        let mut scenario = tight(ENGINES[engine]);
        match more {
            0 => {}
            1 => scenario.faults = coming_and_going(&scenario.robots),
            2 => scenario = with_leaving(scenario),
            3 => scenario = with_batteries(with_amounts(scenario)),
            _ => scenario = with_times(scenario),
        }
        let scenario = with_loads(scenario);
        let robots = scenario.robots.len();
        let mut table = Table::new(scenario.clone(), options(ENVS, seed));
        let names = table.batch.rules().layout.names();
        let column = |name: &str| names.iter().position(|other| other == name).expect(name);
        let (share, depot) = (column("own.load"), column("own.depot.x"));
        let mut chance = chance(seed);
        for _ in 0..STEPS {
            let before: Vec<_> = table.batch.worlds().cloned().collect();
            table.step(&(0..ENVS * robots).map(|_| random_drive(&mut chance)).collect::<Vec<_>>());
            let after: Vec<_> = table.batch.worlds().cloned().collect();
            for (env, (old, new)) in zip(&before, &after).enumerate() {
                let absent = old.absent(table.batch.rules());
                for (robot, one) in scenario.robots.iter().enumerate() {
                    let row = &table.obs[(env * robots + robot) * names.len()..][..names.len()];
                    let seen = one.load.map_or(1.0, |full| new.loads[robot] as f32 / full as f32);
                    let at = [new.positions[robot].x, new.positions[robot].y];
                    let depths = scenario.depots.iter().map(|one| depth(one, at));
                    let deepest = depths.fold(f64::NEG_INFINITY, f64::max);
                    if more != 1 && new.absent(table.batch.rules()) >> robot & 1 == 0 {
                        prop_assert!((row[share] - seen).abs() < 1e-6);
                        let way = f64::from(row[depot].hypot(row[depot + 1]));
                        prop_assert!((way - (scenario.depots[0].radius_m - deepest)).abs() < 1e-5);
                    }
                    let Some(full) = one.load else {
                        prop_assert!(new.loads[robot] == 0);
                        continue;
                    };
                    let helps = |rescue: &&Rescue| {
                        rescue.env as usize == env && rescue.helpers.contains(&Some(robot as u8))
                    };
                    let helped = table.rescues.iter().filter(helps).count() as u32;
                    prop_assert!(helped <= u32::from(old.loads[robot] > 0));
                    let left = old.loads[robot] - helped;
                    if new.step == 0 {
                        prop_assert_eq!(new.loads[robot], full);
                    } else if absent >> robot & 1 == 1 {
                        prop_assert_eq!(new.loads[robot], old.loads[robot]);
                    } else if deepest.abs() > 1e-6 {
                        prop_assert_eq!(new.loads[robot], if deepest > 0.0 { full } else { left });
                    }
                }
            }
        }
    }

    /// Without depots, loads lack what robots helped with, and never more than there was.
    #[test]
    fn what_loads_lack_are_the_rescues_that_their_robots_helped_with(
        seed in 0..10_000_u64,
        engine in 0..2_usize,
    ) {
        let mut scenario = with_loads(tight(ENGINES[engine]));
        scenario.depots.clear();
        scenario.episode_steps = STEPS as u32 + 1;
        let mut table = Table::new(scenario.clone(), options(ENVS, seed));
        let (mut chance, mut helped) = (chance(seed), [0_u32; ENVS]);
        for _ in 0..STEPS {
            table.step(&(0..ENVS * 4).map(|_| random_drive(&mut chance)).collect::<Vec<_>>());
            for rescue in &table.rescues {
                let loaded = |robot: &&u8| scenario.robots[usize::from(**robot)].load.is_some();
                helped[rescue.env as usize] += rescue.helpers.iter().flatten().filter(loaded).count() as u32;
            }
            for (world, helped) in zip(table.batch.worlds(), helped) {
                let full = scenario.robots.iter().filter_map(|robot| robot.load);
                prop_assert_eq!(full.sum::<u32>() - world.loads.iter().sum::<u32>(), helped);
            }
        }
    }

    /// A load that is larger than the rescues of an episode changes nothing.
    #[test]
    fn a_load_that_lasts_changes_nothing(
        seed in 0..10_000_u64,
        engine in 0..2_usize,
        potential in any::<bool>(),
    ) {
        let mut plain = tight(ENGINES[engine]);
        plain.shaping = if potential { Shaping::Potential } else { Shaping::Progress };
        let mut lasting = plain.clone();
        lasting.robots.iter_mut().for_each(|robot| robot.load = Some(1000));
        let mut tables = [plain, lasting].map(|scenario| Table::new(scenario, options(ENVS, seed)));
        let mut chance = chance(seed);
        for _ in 0..STEPS {
            let drives: Vec<_> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
            for table in &mut tables {
                table.step(&drives);
            }
            prop_assert!(tables[0].reward == tables[1].reward && tables[0].rescues == tables[1].rescues);
            for (one, other) in zip(tables[0].batch.worlds(), tables[1].batch.worlds()) {
                prop_assert!(one.positions == other.positions && one.victims == other.victims);
            }
        }
    }
}

#[test]
fn what_is_of_no_use_is_refused() {
    type Change = fn(&mut Scenario);
    let refusal = |change: Change| {
        let mut scenario = with_loads(Scenario::default());
        change(&mut scenario);
        Rules::new(scenario).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let cases: [(Change, &str); 10] = [
        (|_| (), ""),
        (|scenario| scenario.depots.clear(), ""),
        (|scenario| scenario.robots[2].load = Some(0), "scenario.robots[2].load = 0: must be in 1..=1000"),
        (|scenario| scenario.robots[2].load = Some(1001), "scenario.robots[2].load = 1001: must be in 1.."),
        (
            |scenario| scenario.depots[1].radius_m = 0.0,
            "scenario.depots[1].radius_m = 0: must be in 0.001..=10 m",
        ),
        (
            |scenario| scenario.depots[0].position_m[1] = -1.5,
            "scenario.depots[0].position_m[1] = -1.5: must be in -1..=1 m",
        ),
        (
            |scenario| scenario.depots[0] = Depot { position_m: [1.0, 1.0], radius_m: 0.05 },
            "scenario.depots[0].position_m = [1.0, 1.0]: is farther than radius_m from where robots with a load \
             can be; walls keep them off",
        ),
        (
            |scenario| {
                scenario.obstacles = vec![Obstacle {
                    shape: Shape::Box,
                    radius_m: None,
                    half_extents_m: Some([0.1, 0.1]),
                    position_m: Some([0.15, -0.35]),
                    layers: None,
                }];
            },
            "scenario.depots[0].position_m = [0.2, -0.3]: is inside obstacles[0]",
        ),
        (
            |scenario| scenario.robots.iter_mut().for_each(|robot| robot.load = None),
            "scenario.depots (their number) = 2: must be 0: no robot has a load",
        ),
        (
            |scenario| scenario.depots = vec![scenario.depots[0].clone(); 65],
            "scenario.depots (their number) = 65: must be in 0..=64",
        ),
    ];
    for (change, wanted) in cases {
        let refused = refusal(change);
        assert!(refused.starts_with(wanted) && refused.is_empty() == wanted.is_empty(), "{refused}");
    }
}
