//! Both engines against the truth: the same period at 96 substeps of rapier. `discs` may stand in for
//! `rapier` because it is nearer to the truth, over a hundred thousand contacts.

use innerattn_env::geometry::Vec2;
use innerattn_env::physics::{Physics, Workspace};
use innerattn_env::robot::Body;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Engine, Scenario};
use innerattn_env::world::World;

use crate::common::{chance, mixed_team, some_obstacles};

/// Robots in contact in each kind of scene.
const CONTACTS: usize = 34_000;

/// How far an engine is from the truth, over all robots that touch something in a period.
#[derive(Default)]
struct Errors {
    /// |Δposition|, m.
    position: Vec<f32>,
    /// |Δvelocity|, m/s.
    velocity: Vec<f32>,
    /// Overlaps of two robots at a period's end, m.
    overlap: Vec<f32>,
    /// Robots turned aside that touch nothing in truth.
    ghosts: usize,
    /// Robots that touch something in truth and were not turned aside.
    missed: usize,
}

impl Errors {
    fn add(&mut self, team: &[Body], before: &[Vec2], ours: &Moved, truth: &Moved) {
        let turned = |moved: &Moved, robot: usize| (moved.velocities[robot] - before[robot]).norm() > 1e-2;
        for robot in 0..team.len() {
            match (turned(ours, robot), turned(truth, robot)) {
                (true, false) => self.ghosts += 1,
                (false, true) => self.missed += 1,
                _ => (),
            }
            if truth.touched >> robot & 1 == 1 {
                self.position.push((ours.positions[robot] - truth.positions[robot]).norm());
                self.velocity.push((ours.velocities[robot] - truth.velocities[robot]).norm());
            }
            for other in 0..robot {
                let reach = team[robot].radius + team[other].radius;
                let apart = (ours.positions[robot] - ours.positions[other]).norm();
                self.overlap.push((reach - apart).max(0.0));
            }
        }
    }

    /// Means of position and velocity errors and their 99th percentiles, and the largest overlap.
    fn summary(&mut self, name: &str) -> [f32; 5] {
        let both = |values: &mut Vec<f32>| {
            values.sort_unstable_by(f32::total_cmp);
            (values.iter().sum::<f32>() / values.len() as f32, values[values.len() * 99 / 100])
        };
        let (position, velocity) = (both(&mut self.position), both(&mut self.velocity));
        let overlap = both(&mut self.overlap).1.max(self.overlap[self.overlap.len() - 1]);
        println!(
            "{name}: position off by {:.1} um (p99 {:.0}), velocity by {:.2} mm/s (p99 {:.0}), overlap at \
             most {:.1} um, {} ghosts, {} missed, of {} contacts",
            1e6 * position.0,
            1e6 * position.1,
            1e3 * velocity.0,
            1e3 * velocity.1,
            1e6 * overlap,
            self.ghosts,
            self.missed,
            self.position.len()
        );
        [position.0, position.1, velocity.0, velocity.1, overlap]
    }
}

/// A team after one period.
struct Moved {
    positions: Vec<Vec2>,
    velocities: Vec<Vec2>,
    touched: u64,
}

fn moved(physics: &Physics, workspace: &mut Workspace, world: &World, velocities: &[Vec2]) -> Moved {
    let (mut positions, mut velocities) = (world.positions.clone(), velocities.to_vec());
    let touched = physics.advance(workspace, &mut positions, &mut velocities, &world.obstacles, 0);
    Moved { positions, velocities, touched }
}

/// Steers worlds of `scenario` at random and moves each period thrice: by rapier as it is by default,
/// by discs, and in truth.
fn compare(name: &str, scenario: &Scenario) {
    let rules = Rules::new(Scenario { engine: Engine::Discs, ..scenario.clone() }).expect("a valid scenario");
    let rapier = |substeps| {
        let scenario = Scenario { substeps, engine: Engine::Rapier, ..scenario.clone() };
        Rules::new(scenario).expect("a valid scenario").physics
    };
    let (coarse, fine) = (rapier(scenario.substeps), rapier(96));
    let (mut workspace, mut chance) = (Workspace::default(), chance(11));
    let (mut of_rapier, mut of_discs) = (Errors::default(), Errors::default());
    let mut episode = 0;
    let mut world = World::new(&rules, 0, 0);
    let mut drives = vec![[0.0; 2]; rules.team.len()];
    while of_discs.position.len() < CONTACTS {
        if episode % 25 == 0 {
            world.begin(&rules, episode / 25);
        }
        episode += 1;
        for drive in &mut drives {
            if chance.below(4) == 0 {
                // No lattice of places, on which touches at a period's very end would be common.
                let angle = chance.between(0.0, std::f32::consts::TAU);
                *drive = [angle.cos(), angle.sin()];
            }
        }
        let velocities: Vec<Vec2> = (0..drives.len())
            .map(|robot| rules.team[robot].driven(world.velocities[robot], drives[robot].into(), 1.0))
            .collect();
        let truth = moved(&fine, &mut workspace, &world, &velocities);
        let discs = moved(&rules.physics, &mut workspace, &world, &velocities);
        if truth.touched != 0 {
            let six = moved(&coarse, &mut workspace, &world, &velocities);
            of_rapier.add(&rules.team, &velocities, &six, &truth);
            of_discs.add(&rules.team, &velocities, &discs, &truth);
        }
        (world.positions, world.velocities) = (discs.positions, discs.velocities);
    }
    let (rapier, discs) =
        (of_rapier.summary(&format!("{name}, rapier")), of_discs.summary(&format!("{name}, discs ")));
    for (quantity, (discs, rapier)) in
        ["position", "its p99", "velocity", "its p99", "overlap"].iter().zip(discs.iter().zip(&rapier))
    {
        assert!(discs < rapier, "{name}, {quantity}: {discs} is not below {rapier}");
    }
    assert!(of_discs.ghosts <= of_rapier.ghosts, "{name}: {} ghosts", of_discs.ghosts);
    assert!(of_discs.missed <= of_rapier.missed, "{name}: {} missed", of_discs.missed);
}

fn tight() -> Scenario {
    Scenario { arena_half_width_m: 0.4, spawn_clearance_m: 0.05, ..Scenario::default() }
}

#[test]
fn discs_are_nearer_to_the_truth_for_the_default_team() {
    compare("default team", &tight());
}

#[test]
fn discs_are_nearer_to_the_truth_for_unlike_robots() {
    compare("eight unlike robots", &Scenario { robots: mixed_team(8), ..tight() });
}

#[test]
fn discs_are_nearer_to_the_truth_among_obstacles() {
    compare("obstacles", &Scenario { obstacles: some_obstacles(), arena_half_width_m: 0.7, ..tight() });
}
