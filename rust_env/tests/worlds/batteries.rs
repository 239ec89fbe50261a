//! Batteries: what holds of charges and of robots without energy, whatever the robots do.

use std::iter::zip;

use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Battery, Engine, Obstacle, Scenario, Shape, Shaping, Station};
use proptest::prelude::*;

use crate::common::{
    ENGINES, Table, chance, coming_and_going, options, random_drive, with_batteries, with_leaving,
};

const ENVS: usize = 3;
const STEPS: usize = 60;

fn tight(engine: Engine) -> Scenario {
    let shaping = Shaping::Progress;
    Scenario { engine, shaping, arena_half_width_m: 0.7, spawn_clearance_m: 0.1, ..Scenario::default() }
}

/// The charge after a period in which a robot went so far and stands at `at`, J, by the rule.
fn accounted(scenario: &Scenario, battery: &Battery, charge: f64, way: f64, at: [f64; 2]) -> f64 {
    let here = |one: &&Station| (one.position_m[0] - at[0]).hypot(one.position_m[1] - at[1]) <= one.radius_m;
    let given = scenario.stations.iter().filter(here).map(|one| one.recharge_w).fold(0.0, f64::max);
    let used = battery.per_m_j * way + battery.idle_w * scenario.dt_s;
    (charge - used + given * scenario.dt_s).clamp(0.0, battery.capacity_j)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Charges are what way, time and stations make them; who has none neither drives nor helps; all see it.
    #[test]
    fn charges_are_accounted_for(seed in 0..10_000_u64, engine in 0..2_usize, faulty in 0..3_usize) {
        let mut scenario = tight(ENGINES[engine]);
        match faulty {
            0 => {}
            1 => scenario.faults = coming_and_going(&scenario.robots),
            _ => scenario = with_leaving(scenario),
        }
        let scenario = with_batteries(scenario);
        let robots = scenario.robots.len();
        let mut table = Table::new(scenario.clone(), options(ENVS, seed));
        let names = table.batch.rules().layout.names();
        let column = |name: &str| names.iter().position(|other| other == name).expect(name);
        let (charge, station) = (column("own.charge"), column("own.station.x"));
        let mut chance = chance(seed);
        for _ in 0..STEPS {
            let before: Vec<_> = table.batch.worlds().cloned().collect();
            table.step(&(0..ENVS * robots).map(|_| random_drive(&mut chance)).collect::<Vec<_>>());
            let after: Vec<_> = table.batch.worlds().cloned().collect();
            for (env, (old, new)) in zip(&before, &after).enumerate() {
                let absent = old.absent(table.batch.rules());
                let back = absent | new.absent(table.batch.rules());
                for (robot, one) in scenario.robots.iter().enumerate() {
                    let row = &table.obs[(env * robots + robot) * names.len()..][..names.len()];
                    let share = one.battery.map_or(1.0, |battery| new.charges[robot] / battery.capacity_j);
                    if faulty == 0 {
                        prop_assert!((f64::from(row[charge]) - share).abs() < 1e-6);
                        let way = |one: &Station| {
                            let [x, y] = one.position_m.map(|metres| metres as f32);
                            [x - new.positions[robot].x, y - new.positions[robot].y]
                        };
                        let length = |way: &[f32; 2]| way[0].hypot(way[1]);
                        let ways = scenario.stations.iter().map(way);
                        let nearest = ways.min_by(|a, b| length(a).total_cmp(&length(b))).expect("one");
                        prop_assert!((length(&nearest) - row[station].hypot(row[station + 1])).abs() < 1e-5);
                    }
                    let Some(battery) = one.battery else {
                        prop_assert!(new.charges[robot] == 0.0);
                        continue;
                    };
                    if new.step == 0 {
                        prop_assert_eq!(new.charges[robot].to_bits(), battery.capacity_j.to_bits());
                    } else if absent >> robot & 1 == 1 {
                        prop_assert_eq!(new.charges[robot].to_bits(), old.charges[robot].to_bits());
                    } else if back >> robot & 1 == 0 {
                        let [from, to] = [old, new].map(|world| world.positions[robot]);
                        let way = f64::from((to.x - from.x).hypot(to.y - from.y));
                        let at = [f64::from(to.x), f64::from(to.y)];
                        let wanted = accounted(&scenario, &battery, old.charges[robot], way, at);
                        prop_assert!((new.charges[robot] - wanted).abs() < 1e-5);
                    }
                    let empty = new.step > 0 && new.charges[robot] == 0.0;
                    let helps = |rescue: &&innerattn_env::tasks::Rescue| {
                        rescue.env as usize == env && rescue.helpers.contains(&Some(robot as u8))
                    };
                    prop_assert!(!empty || !table.rescues.iter().any(|rescue| helps(&rescue)));
                }
            }
        }
    }

    /// A robot without energy moves as one that is told to stay.
    #[test]
    fn robots_without_energy_stand_still(seed in 0..10_000_u64, engine in 0..2_usize) {
        let mut scenario = tight(ENGINES[engine]);
        for robot in &mut scenario.robots {
            robot.battery = Some(Battery { capacity_j: 1e-3, per_m_j: 0.0, idle_w: 0.009 });
        }
        let mut tables = [0, 1].map(|_| Table::new(scenario.clone(), options(ENVS, seed)));
        let mut chance = chance(seed);
        for step in 0..scenario.episode_steps - 1 {
            let drives: Vec<_> = (0..ENVS * 4).map(|_| random_drive(&mut chance)).collect();
            let still = vec![[0.0; 2]; ENVS * 4];
            tables[0].step(&drives);
            tables[1].step(if step < 2 { &drives } else { &still });
            prop_assert!(tables[0].shown(0, ENVS) == tables[1].shown(0, ENVS));
            prop_assert!(step < 1 || tables[0].rescues.is_empty());
            let empty = |world: &innerattn_env::world::World| world.charges.iter().all(|charge| *charge == 0.0);
            prop_assert!(tables[0].batch.worlds().all(empty) == (step >= 1));
        }
    }

    /// A battery that is never empty changes nothing.
    #[test]
    fn a_battery_that_lasts_changes_nothing(seed in 0..10_000_u64, engine in 0..2_usize) {
        let plain = tight(ENGINES[engine]);
        let mut lasting = plain.clone();
        for robot in &mut lasting.robots {
            robot.battery = Some(Battery { capacity_j: 1e6, per_m_j: 1.0, idle_w: 1.0 });
        }
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
        let mut scenario = with_batteries(Scenario::default());
        change(&mut scenario);
        Rules::new(scenario).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let battery = |capacity_j, per_m_j, idle_w| Some(Battery { capacity_j, per_m_j, idle_w });
    assert_eq!(refusal(|_| ()), "");
    let cases: [(Change, &str); 10] = [
        (|scenario| scenario.robots[1].battery = None, ""),
        (
            |scenario| {
                scenario.robots[2].battery = Some(Battery { capacity_j: 1.0, per_m_j: 0.0, idle_w: 0.0 });
            },
            "scenario.robots[2].battery.per_m_j = 0: must be above 0 where idle_w is 0, or nothing is used",
        ),
        (
            |scenario| {
                scenario.robots[2].battery = Some(Battery { capacity_j: 0.0, per_m_j: 1.0, idle_w: 0.0 });
            },
            "scenario.robots[2].battery.capacity_j = 0: must be in 0.001..=1000000000 J",
        ),
        (
            |scenario| {
                scenario.stations.clear();
                scenario.spawn_clearance_m = 0.5;
                scenario.rescue_radius_m = 0.25;
                scenario.robots[2].battery = Some(Battery { capacity_j: 1.0, per_m_j: 4.0, idle_w: 0.0 });
            },
            "scenario.robots[2].battery.capacity_j = 1: must be above 1.000000 J, or \"navigation_0\" can help no \
             victim: the first is at least 0.250000 m away, and no station charges it",
        ),
        (
            |scenario| scenario.stations[1].recharge_w = 0.0,
            "scenario.stations[1].recharge_w = 0: must be in 0.001..=1000000 W",
        ),
        (|scenario| scenario.stations[0].radius_m = 0.0, "scenario.stations[0].radius_m = 0: must be in"),
        (
            |scenario| scenario.stations[0].position_m[1] = 1.5,
            "scenario.stations[0].position_m[1] = 1.5: must be",
        ),
        (
            |scenario| {
                scenario.stations[0].position_m = [1.0, 1.0];
                scenario.stations[0].radius_m = 0.05;
            },
            "scenario.stations[0].position_m = [1.0, 1.0]: is farther than radius_m from where robots",
        ),
        (
            |scenario| {
                scenario.obstacles = vec![Obstacle {
                    shape: Shape::Disc,
                    radius_m: Some(0.1),
                    half_extents_m: None,
                    position_m: Some([-0.35, -0.2]),
                    layers: None,
                }];
            },
            "scenario.stations[0].position_m = [-0.3, -0.2]: is inside obstacles[0]",
        ),
        (
            |scenario| scenario.robots.iter_mut().for_each(|robot| robot.battery = None),
            "scenario.stations (their number) = 2: must be 0: no robot has a battery",
        ),
    ];
    for (change, wanted) in cases {
        let refused = refusal(change);
        assert!(refused.starts_with(wanted) && refused.is_empty() == wanted.is_empty(), "{refused}");
    }
    // A way that is known: from the start to the nearer of two places.
    let far = |capacity_j| {
        let mut scenario = Scenario {
            victim_places_m: vec![[0.5, 0.0], [0.9, 0.0]],
            rescue_radius_m: 0.25,
            ..Scenario::default()
        };
        scenario.robots[0].start_m = Some([-0.5, 0.0]);
        scenario.robots[0].battery = battery(capacity_j, 4.0, 0.0);
        Rules::new(scenario).is_err()
    };
    assert!(far(3.0) && !far(3.001));
}
