//! What comes from outside, altered at random: images with a right checksum, texts of scenarios, and
//! steps. Each is refused, or taken and then played without a failure.
//!
//! `INNERATTN_FUZZ_SECONDS` says how long each test goes on.

use std::time::{Duration, Instant};

use innerattn_env::batch::Batch;
use innerattn_env::rng::Stream;
use innerattn_env::robot::Commands;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Actions, Engine, Scenario};
use serde_json::{Value, json};

use crate::common::{
    ENGINES, Table, chance, coming_and_going, mixed_team, options, random_drive, some_obstacles,
    with_amounts, with_an_end, with_areas, with_arrivals, with_batteries, with_layers, with_leaving,
    with_list, with_loads, with_map, with_order, with_radio, with_rays, with_sight, with_times, with_wheels,
};

const ENVS: usize = 2;

/// Repeats `attempt` until the time is up; says how often it was.
pub fn for_a_while(what: &str, mut attempt: impl FnMut(&mut Stream) -> bool) {
    let seconds = std::env::var("INNERATTN_FUZZ_SECONDS").map_or(1.0, |text| text.parse().expect("a number"));
    let (start, mut source) = (Instant::now(), chance(2));
    let (mut tried, mut taken) = (0_u64, 0_u64);
    while tried < 100 || start.elapsed() < Duration::from_secs_f64(seconds) {
        tried += 1;
        taken += u64::from(attempt(&mut source));
    }
    println!("{what}: {tried} tried, {taken} of them taken");
    assert!(taken > 0 && taken < tried, "{what}: {taken} of {tried} were taken, so nothing was tested");
}

fn scenarios() -> Vec<Scenario> {
    let tight = Scenario { arena_half_width_m: 0.7, spawn_clearance_m: 0.1, ..Scenario::default() };
    let with = |engine: Engine| {
        [
            Scenario { engine, ..tight.clone() },
            Scenario {
                engine,
                actions: Actions::Continuous,
                obstacles: some_obstacles(),
                robots: mixed_team(6),
                ..Scenario::default()
            },
            Scenario {
                engine,
                faults: coming_and_going(&tight.robots),
                observe_faults: true,
                ..tight.clone()
            },
            with_times(Scenario { engine, ..tight.clone() }),
            with_amounts(Scenario { engine, ..tight.clone() }),
            with_order(Scenario { engine, ..tight.clone() }),
            with_areas(Scenario { engine, ..tight.clone() }),
            with_arrivals(Scenario { engine, ..tight.clone() }),
            with_list(Scenario { engine, ..tight.clone() }),
            with_an_end(Scenario { engine, ..tight.clone() }),
            with_leaving(Scenario { engine, ..tight.clone() }),
            with_batteries(Scenario { engine, ..tight.clone() }),
            with_loads(Scenario { engine, ..tight.clone() }),
            with_layers(Scenario { engine, obstacles: some_obstacles(), ..Scenario::default() }),
            with_sight(Scenario { engine, obstacles: some_obstacles(), ..Scenario::default() }),
            with_sight(with_leaving(Scenario { engine, ..tight.clone() })),
            with_map(with_sight(Scenario { engine, obstacles: some_obstacles(), ..Scenario::default() })),
            with_radio(with_leaving(Scenario { engine, ..tight.clone() })),
            with_rays(with_map(with_wheels(Scenario {
                engine,
                obstacles: some_obstacles(),
                ..Scenario::default()
            }))),
            with_wheels(with_leaving(Scenario { engine, ..tight.clone() })),
            with_wheels(Scenario { engine, actions: Actions::Continuous, ..tight.clone() }),
        ]
    };
    ENGINES.into_iter().flat_map(with).collect()
}

/// Steps with allowed actions; what was taken must bear them.
fn play(table: &mut Table, source: &mut Stream, steps: usize) {
    for _ in 0..steps {
        let actions: Vec<[f32; 2]> = (0..table.reward.len()).map(|_| random_drive(source)).collect();
        table.step(&actions);
        assert!(table.obs.iter().chain(&table.reward).all(|number| number.is_finite()));
        let half = table.batch.rules().scenario.arena_half_width_m as f32;
        for world in table.batch.worlds() {
            assert!(world.positions.iter().all(|place| place.amax() <= half));
        }
    }
}

#[test]
fn forged_images_are_refused_or_played() {
    let mut tables: Vec<(Table, Vec<u8>)> = scenarios()
        .into_iter()
        .map(|scenario| {
            let mut table = Table::new(scenario, options(ENVS, 3));
            play(&mut table, &mut chance(1), 9);
            let image = table.batch.snapshot();
            (table, image)
        })
        .collect();
    for_a_while("forged images", |source| {
        let at = source.below(tables.len());
        let (table, image) = &mut tables[at];
        let mut body = image[..image.len() - 4].to_vec();
        for _ in 0..=source.below(3) {
            // Most of an image is its scenario, which must be the batch's own: aim behind it.
            let from = body.len() - body.len() / 3;
            let place = from + source.below(body.len() - from);
            match source.below(4) {
                0 => body[place] ^= 1 << source.below(8),
                1 => body[place] = source.below(256) as u8,
                2 => body.insert(place, source.below(256) as u8),
                _ => drop(body.remove(place)),
            }
        }
        let checksum = crc32fast::hash(&body);
        body.extend(checksum.to_le_bytes());
        let before = table.batch.snapshot();
        if table.batch.restore(&body).is_ok() {
            play(table, source, 2);
            table.batch.restore(image).expect("the image itself");
            true
        } else {
            assert!(table.batch.snapshot() == before, "a refused image changed the batch");
            false
        }
    });
}

/// A value that a text may hold in any place.
fn strange(source: &mut Stream) -> Value {
    let large = "x".repeat(300);
    let values = [
        json!(null),
        json!(true),
        json!(-1),
        json!(0),
        json!(1),
        json!(2),
        json!(0.5),
        json!(1e-320),
        json!(1e308),
        json!(-1e308),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(33),
        json!(""),
        json!("food_0"),
        json!("discs"),
        json!("rapier"),
        json!("none"),
        json!("air"),
        json!(["air"]),
        json!("velocity"),
        json!("unicycle"),
        json!("differential"),
        json!(large),
        json!([]),
        json!([0.1, 0.1]),
        json!({"food": 1.2}),
        json!({}),
        json!({"name": "x"}),
    ];
    values[source.below(values.len())].clone()
}

/// Alters one value somewhere inside.
fn alter(value: &mut Value, source: &mut Stream) {
    let inside = match value {
        Value::Object(map) if !map.is_empty() && source.below(8) > 0 => {
            let at = source.below(map.len());
            if source.below(40) == 0 {
                let key = map.keys().nth(at).expect("a key").clone();
                map.remove(&key);
                return;
            }
            map.values_mut().nth(at)
        }
        Value::Array(list) if !list.is_empty() && source.below(4) > 0 => {
            let at = source.below(list.len());
            if source.below(10) == 0 {
                let again = list[at].clone();
                list.push(again);
                return;
            }
            list.get_mut(at)
        }
        _ => None,
    };
    match inside {
        Some(one) => alter(one, source),
        None => *value = strange(source),
    }
}

#[test]
fn texts_of_scenarios_are_refused_or_played() {
    let texts: Vec<Value> =
        scenarios().iter().map(|scenario| serde_json::from_str(&scenario.to_json()).expect("JSON")).collect();
    for_a_while("texts of scenarios", |source| {
        let mut text = texts[source.below(texts.len())].clone();
        for _ in 0..=source.below(2) {
            alter(&mut text, source);
        }
        let rules = match Rules::from_json(&text.to_string()) {
            Ok(rules) => rules,
            Err(error) => {
                let said = error.to_string();
                assert!(!said.contains('\n') && said.len() < 2_000, "{said}");
                return false;
            }
        };
        let scenario = rules.scenario.clone();
        assert_eq!(scenario.to_json(), Scenario::from_json(&scenario.to_json()).expect("itself").to_json());
        if Batch::new(rules, options(ENVS, 4)).is_ok() {
            // Crowded arenas may have no free place: that is an error of the worlds, and not a panic.
            if let Ok(mut table) = std::panic::catch_unwind(|| Table::new(scenario, options(ENVS, 4))) {
                let rows = table.reward.len();
                let actions = vec![1_i64; rows];
                let drives = vec![0.5_f32; rows * 2];
                let commands = match table.batch.rules().scenario.actions {
                    Actions::Discrete => Commands::Discrete(&actions),
                    Actions::Continuous => Commands::Continuous(&drives),
                };
                if let Err(error) = table.try_step(commands) {
                    assert!(error.to_string().contains("no free place"), "{error}");
                }
            }
        }
        true
    });
}

#[test]
fn steps_are_refused_and_change_nothing_or_are_played() {
    let mut tables: Vec<Table> =
        scenarios().into_iter().map(|scenario| Table::new(scenario, options(ENVS, 3))).collect();
    for_a_while("steps", |source| {
        let at = source.below(tables.len());
        let table = &mut tables[at];
        let before = table.batch.snapshot();
        let rows = table.reward.len() + [0, 0, 0, 0, 1, 2][source.below(6)] - [0, 0, 0, 1][source.below(4)];
        let ids = [0, 1, 2, 3, 4, 4, 3, 2, 1, 0, 5, -1, i64::MIN, i64::MAX];
        let forces = [0.0, 1.0, -1.0, 0.3, -0.2, 0.7, 1.5, f32::NAN, f32::INFINITY, -f32::INFINITY, 1e-40];
        let (most, wide) = if source.below(2) == 0 { (10, 6) } else { (ids.len(), forces.len()) };
        let discrete: Vec<i64> = (0..rows).map(|_| ids[source.below(most)]).collect();
        let continuous: Vec<f32> = (0..rows * 2).map(|_| forces[source.below(wide)]).collect();
        let commands = if source.below(2) == 0 {
            Commands::Discrete(&discrete)
        } else {
            Commands::Continuous(&continuous)
        };
        if table.try_step(commands).is_ok() {
            assert!(table.obs.iter().chain(&table.reward).all(|number| number.is_finite()));
            true
        } else {
            assert!(table.batch.snapshot() == before, "a refused step changed the batch");
            false
        }
    });
}
