//! Worlds do what the kept digests say, in this build too; `tests/cross/digests.py` made them with the
//! optimised one.

use crc32fast::Hasher;
use innerattn_env::batch::Options;
use innerattn_env::scenario::Scenario;
use serde_json::Value;

use crate::common::{Table, options};

const KEPT: &str = include_str!("../../../tests/cross/digests.json");

/// Scenarios whose worlds do something else in this build.
const OTHERS: [&str; 0] = [];

/// The force of an action, for continuous actions; discrete ones are told by it.
const DRIVES: [[f32; 2]; 5] = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];

fn drive(step: u64, env: u64, robot: u64) -> [f32; 2] {
    let mixed = (step * 7919 + env * 104_729 + robot * 1_299_709).wrapping_mul(2_654_435_761);
    DRIVES[((mixed >> 16) % 5) as usize]
}

fn crc32(scenario: Scenario, envs: usize, steps: u64, seed: u64) -> u32 {
    let robots = scenario.robots.len();
    let mut table = Table::new(scenario, Options { num_envs: envs, ..options(envs, seed) });
    let mut hasher = Hasher::new();
    let row = table.obs.len() / envs;
    for step in 0..steps {
        let actions: Vec<[f32; 2]> =
            (0..envs * robots).map(|at| drive(step, (at / robots) as u64, (at % robots) as u64)).collect();
        table.step(&actions);
        for env in 0..envs {
            let obs = &table.obs[env * row..][..row];
            let reward = &table.reward[env * robots..][..robots];
            for value in obs.iter().chain(reward) {
                hasher.update(&value.to_le_bytes());
            }
            hasher.update(&[u8::from(table.terminated[env]), u8::from(table.truncated[env])]);
        }
    }
    hasher.finalize()
}

#[test]
fn worlds_do_what_they_did() {
    let kept: Value = serde_json::from_str(KEPT).expect("JSON");
    let number = |key: &str| kept[key].as_u64().expect("a number");
    let rows = kept["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 14);
    let others = rows.iter().filter(|row| {
        let scenario = Scenario::from_json(&row["scenario"].to_string()).expect("a scenario");
        let found = crc32(scenario, number("num_envs") as usize, number("steps"), number("seed"));
        Some(u64::from(found)) != row["crc32"].as_u64()
    });
    let others: Vec<&str> = others.filter_map(|row| row["name"].as_str()).collect();
    assert_eq!(others, OTHERS);
}
