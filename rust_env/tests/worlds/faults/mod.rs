//! What faults do to robots, and what they leave alone.

#![allow(clippy::float_cmp)] // what is compared is the same to the bit, or a level as it was set

mod motion;
mod onset;
mod properties;
mod senses;

use innerattn_env::fault::Fault;
use innerattn_env::geometry::Vec2;
use innerattn_env::scenario::{Robot, Scenario};

use crate::common::Table;

const EAST: [f32; 2] = [1.0, 0.0];
const STAY: [f32; 2] = [0.0, 0.0];

/// One robot alone in a wide arena: nothing to touch.
fn alone(faults: Vec<Fault>) -> Scenario {
    let robots: Vec<Robot> = Scenario::default().robots.into_iter().take(1).collect();
    let mut scenario =
        Scenario { robots, faults, arena_half_width_m: 100.0, episode_steps: 100, ..Scenario::default() };
    scenario.tasks.truncate(1);
    scenario.tasks[0].needs = vec!["food".into()].into();
    scenario
}

fn place(table: &Table, robot: usize) -> Vec2 {
    table.batch.worlds().next().expect("a world").positions[robot]
}

/// The row that `robot` sees in the table's first world.
fn row(table: &Table, robot: usize) -> Vec<f32> {
    let width = table.batch.rules().layout.width();
    table.obs[robot * width..][..width].to_vec()
}

fn column(table: &Table, name: &str) -> usize {
    let names = table.batch.rules().layout.names();
    names.iter().position(|other| other == name).expect("a column")
}

/// The default team in a long episode, with these faults.
fn team(faults: Vec<Fault>) -> Scenario {
    Scenario { faults, episode_steps: 60, ..Scenario::default() }
}
