//! Robots stay where they can be: no play drives one out of the arena, through an obstacle or through
//! another robot, and overlaps stay small beside a radius. Half a million env-steps for each engine;
//! twenty times as many with `INNERATTN_SLOW=1`.

use innerattn_env::geometry::{Solid, Vec2};
use innerattn_env::rng::Stream;
use innerattn_env::robot::Body;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Actions, Engine, Scenario};
use innerattn_env::world::World;

use crate::common::{
    ENGINES, Table, cells_of, chance, mixed_team, options, random_drive, some_obstacles, with_layers,
    with_map,
};

const ENVS: usize = 250;
/// Largest overlap at a period's end as a share of the smaller radius: of all, and at the 99.9th percentile.
const MOST: f32 = 0.05;
const USUAL: f32 = 0.01;

#[derive(Debug, Clone, Copy)]
pub enum Play {
    /// Random discrete actions.
    Random,
    /// Everyone into one corner.
    Corner,
    /// Pairs charge at each other from afar, again and again.
    HeadOn,
    /// Everyone after one robot, which flees into a corner.
    Chase,
}

pub const PLAYS: [Play; 4] = [Play::Random, Play::Corner, Play::HeadOn, Play::Chase];

impl Play {
    pub fn drive(self, world: &World, robot: usize, chance: &mut Stream) -> [f32; 2] {
        let own = world.positions[robot];
        let robots = world.positions.len();
        let phase = (world.step / 12) as usize;
        let away = match self {
            Self::Random => return random_drive(chance),
            Self::Corner => Vec2::new(9.0, if world.stream.is_multiple_of(2) { 9.0 } else { 8.0 }) - own,
            Self::HeadOn => {
                let partner = world.positions[(robot ^ 1) % robots] - own;
                if phase.is_multiple_of(2) { partner } else { -partner }
            }
            Self::Chase => {
                let prey = (world.stream as usize + phase) % robots;
                if prey == robot { own } else { world.positions[prey] - own }
            }
        };
        let drive = away / away.norm().max(1e-6);
        [drive.x, drive.y]
    }
}

/// The obstacles and solid cells that block a layer (one bit), and their centres.
fn solids_in(rules: &Rules, world: &World, layer: u64) -> Vec<(Solid, Vec2)> {
    let each =
        rules.solids.iter().copied().zip(world.obstacles.iter().copied()).zip(rules.scenario.blocked());
    let mut solids: Vec<_> =
        each.filter(|(_, blocked)| blocked & layer != 0).map(|(placed, _)| placed).collect();
    let names = rules.scenario.layers();
    let name = names[layer.trailing_zeros() as usize];
    if rules.scenario.map.as_ref().is_some_and(|map| map.blocks(name)) {
        solids.extend(cells_of(&rules.scenario));
    }
    solids
}

/// The deepest overlap of what can touch in a world, as a share of the smaller of the two; of a box that is half its shorter side.
pub fn deepest(rules: &Rules, world: &World) -> f32 {
    let arena = rules.scenario.arena_half_width_m as f32;
    let mut worst = 0.0_f32;
    for (index, (at, body)) in world.positions.iter().zip(&rules.team).enumerate() {
        worst = worst.max((at.amax() + body.radius - arena) / body.radius);
        for (other, from) in world.positions[..index].iter().zip(&rules.team) {
            if from.layer != body.layer {
                continue;
            }
            let overlap = body.radius + from.radius - (at - other).norm();
            worst = worst.max(overlap / body.radius.min(from.radius));
        }
        for (solid, centre) in solids_in(rules, world, body.layer) {
            let small = body.radius.min(solid.half_breadth());
            worst = worst.max((body.radius - solid.nearest(at - centre).0) / small);
        }
    }
    worst
}

/// Panics if somebody went through something since all were at `before`, one period ago. It takes periods in which
/// nobody moves farther than three of the smallest radii: without forces, nobody turns round something else in one.
pub fn check_uncrossed(rules: &Rules, world: &World, before: &[Vec2]) {
    for index in 0..before.len() {
        let Body { radius, layer, .. } = rules.team[index];
        for other in (0..index).filter(|other| rules.team[*other].layer == layer) {
            let near = nearest_to_origin(
                before[index] - before[other],
                world.positions[index] - world.positions[other],
            );
            assert!(
                near > 0.5 * (radius + rules.team[other].radius),
                "robots {other} and {index} crossed: {world:?}"
            );
        }
        for (solid, centre) in solids_in(rules, world, layer) {
            let (start, end) = (before[index] - centre, world.positions[index] - centre);
            let inside = (0..=20).any(|part| {
                let at = start.lerp(&end, part as f32 / 20.0);
                match solid {
                    Solid::Disc(reach) => at.norm() < 0.5 * reach,
                    Solid::Box(half) => at.x.abs() < 0.5 * half.x && at.y.abs() < 0.5 * half.y,
                }
            });
            assert!(!inside, "robot {index} crossed an obstacle: {world:?}");
        }
    }
}

fn nearest_to_origin(from: Vec2, to: Vec2) -> f32 {
    let along = to - from;
    let share = (-from.dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
    (from + along * share).norm()
}

fn play(name: &str, engines: &[Engine], scenario: &Scenario, steps: usize) {
    play_within(name, engines, scenario, steps, (USUAL, MOST));
}

/// Overlaps at the 99.9th percentile and at most stay within `bounds`.
fn play_within(name: &str, engines: &[Engine], scenario: &Scenario, steps: usize, bounds: (f32, f32)) {
    let slow = std::env::var("INNERATTN_SLOW").is_ok_and(|value| value == "1");
    let steps = if slow { 20 * steps } else { steps };
    for (engine, play) in engines.iter().flat_map(|engine| PLAYS.map(|play| (*engine, play))) {
        let scenario = Scenario { engine, ..scenario.clone() };
        let mut table = Table::new(scenario, options(ENVS, 1));
        let mut chance = chance(2);
        let mut overlaps = Vec::with_capacity(steps);
        while overlaps.len() < steps {
            let robots = 0..table.batch.rules().team.len();
            let before: Vec<World> = table.batch.worlds().cloned().collect();
            let drives =
                |world| robots.clone().map(|robot| play.drive(world, robot, &mut chance)).collect::<Vec<_>>();
            let actions: Vec<[f32; 2]> = before.iter().flat_map(drives).collect();
            table.step(&actions);
            for (world, before) in table.batch.worlds().zip(&before) {
                let same = (world.episode == before.episode).then_some(&before.positions[..]);
                overlaps.push(deepest(table.batch.rules(), world));
                if let Some(before) = same {
                    check_uncrossed(table.batch.rules(), world, before);
                }
            }
        }
        overlaps.sort_unstable_by(f32::total_cmp);
        let most = overlaps[overlaps.len() - 1];
        let usual = overlaps[overlaps.len() * 999 / 1000];
        println!(
            "{name}, {engine:?}, {play:?}: overlap of a radius {:.2} % at p99.9, {:.2} % at most",
            100.0 * usual,
            100.0 * most
        );
        assert!(usual <= bounds.0, "{name}, {engine:?}, {play:?}: p99.9 is {usual}");
        assert!(most <= bounds.1, "{name}, {engine:?}, {play:?}: the most is {most}");
    }
}

fn long_episodes() -> Scenario {
    Scenario { actions: Actions::Continuous, episode_steps: 100, ..Scenario::default() }
}

#[test]
fn the_default_team_stays_apart() {
    play("default team", &ENGINES, &long_episodes(), 75_000);
}

#[test]
fn obstacles_hold() {
    play("obstacles", &ENGINES, &Scenario { obstacles: some_obstacles(), ..long_episodes() }, 40_000);
}

#[test]
fn maps_hold() {
    play("map", &ENGINES, &with_map(long_episodes()), 10_000);
    let tight = Scenario { arena_half_width_m: 0.8, ..Scenario { robots: mixed_team(8), ..long_episodes() } };
    play("map and layers", &ENGINES, &with_map(with_layers(tight)), 5_000);
}

#[test]
fn a_crowd_of_unlike_robots_stays_apart() {
    let scenario = Scenario { robots: mixed_team(16), spawn_clearance_m: 0.1, ..long_episodes() };
    play("sixteen", &ENGINES, &scenario, 12_500);
}

#[test]
fn robots_of_a_layer_stay_apart() {
    let crowd = Scenario { robots: mixed_team(12), spawn_clearance_m: 0.1, ..long_episodes() };
    let crowd = Scenario { obstacles: some_obstacles(), ..crowd };
    play("three layers", &ENGINES, &with_layers(crowd), 12_500);
}

#[test]
fn the_fastest_that_a_scenario_allows_stay_apart() {
    // Three radii in a substep of rapier, with overlaps three times as deep as promised; discs know no limit.
    let scenario = Scenario { substeps: 1, ..long_episodes() };
    play_within("three radii a substep", &[Engine::Rapier], &scenario, 12_500, (0.05, 0.15));
    let mut scenario = Scenario { dt_s: 0.005, ..long_episodes() };
    scenario.robots.iter_mut().for_each(|robot| (robot.max_speed_mps, robot.drive_force_n) = (40.0, 1e4));
    play("40 m/s", &[Engine::Discs], &scenario, 12_500);
}

#[test]
fn discs_hold_however_unlike_small_and_fast_the_robots() {
    let mut robots = mixed_team(8);
    for (index, robot) in robots.iter_mut().enumerate() {
        (robot.mass_kg, robot.radius_m) = ([0.1, 10.0][index % 2], 0.02);
        (robot.max_speed_mps, robot.drive_force_n) = (5.0, [20.0, 2000.0][index % 2]);
    }
    let scenario = Scenario { robots, spawn_clearance_m: 0.1, ..long_episodes() };
    // Short periods: in a long one so fast a robot may be turned about by contact after contact, and
    // the straight line from its start to its end says nothing.
    let scenario = Scenario { dt_s: 0.005, damping: 0.1, ..scenario };
    play("extreme", &[Engine::Discs], &scenario, 12_500);
}
