//! Contacts are true: they keep momentum and gain no energy, mass counts, what passes by is left alone
//! and what is hit moves on as it does in the same scene at sixteen times the substeps.

use innerattn_env::fault::{HEALTHY, Kind};
use innerattn_env::geometry::Vec2;
use innerattn_env::physics::Workspace;
use innerattn_env::reward::NUM_COMPONENTS;
use innerattn_env::rng::Stream;
use innerattn_env::robot::Commands;
use innerattn_env::rules::Rules;
use innerattn_env::scenario::{Engine, Scenario};
use innerattn_env::tasks::Events;
use innerattn_env::world::World;

use crate::common::{ENGINES, chance, mixed_team, some_obstacles};

/// A team in motion, for periods in which nobody drives.
struct Scene {
    rules: Rules,
    workspace: Workspace,
    positions: Vec<Vec2>,
    velocities: Vec<Vec2>,
}

impl Scene {
    fn new(scenario: Scenario, positions: &[Vec2], velocities: &[Vec2]) -> Self {
        Self {
            rules: Rules::new(scenario).expect("a valid scenario"),
            workspace: Workspace::default(),
            positions: positions.to_vec(),
            velocities: velocities.to_vec(),
        }
    }

    /// Moves all through one period; returns who touched something, as bits.
    fn advance(&mut self) -> u64 {
        self.rules.physics.advance(&mut self.workspace, &mut self.positions, &mut self.velocities, &[], 0)
    }

    fn momentum(&self) -> Vec2 {
        self.rules.team.iter().zip(&self.velocities).map(|(body, velocity)| velocity * body.mass).sum()
    }

    fn energy(&self) -> f32 {
        let bodies = self.rules.team.iter().zip(&self.velocities);
        bodies.map(|(body, velocity)| 0.5 * body.mass * velocity.norm_squared()).sum()
    }
}

fn direction(chance: &mut Stream) -> Vec2 {
    let angle = chance.between(0.0, std::f32::consts::TAU);
    Vec2::new(angle.cos(), angle.sin())
}

/// Two robots with relative course `miss` apart at the nearest, which they reach after `time` if nothing
/// stops them; the first moves at `speeds.0`, the second at `speeds.1`, around the arena's centre.
fn pass(miss: f32, time: f32, speeds: (f32, f32), chance: &mut Stream) -> ([Vec2; 2], [Vec2; 2]) {
    let velocities = [direction(chance) * speeds.0, direction(chance) * speeds.1];
    let relative = velocities[1] - velocities[0];
    let side = Vec2::new(-relative.y, relative.x).normalize() * miss;
    let meeting = [-side * 0.5, side * 0.5];
    ([meeting[0] - velocities[0] * time, meeting[1] - velocities[1] * time], velocities)
}

fn median(mut values: Vec<f32>) -> f32 {
    values.sort_unstable_by(f32::total_cmp);
    values[values.len() / 2]
}

#[test]
fn momentum_is_kept_and_energy_is_not_gained() {
    for engine in ENGINES {
        let scenario = Scenario { robots: mixed_team(8), engine, ..Scenario::default() };
        let mut scene = Scene::new(scenario, &[], &[]);
        let mut chance = chance(3);
        let (mut touches, mut gains) = (0, 0.0_f32);
        for _ in 0..2000 {
            // On a ring around the centre, all on their way into the middle: no wall is near.
            let spread = chance.between(0.0, 0.3);
            let at = |index: usize| Vec2::new((index as f32 * 0.785).cos(), (index as f32 * 0.785).sin());
            scene.positions = (0..8).map(|index| at(index) * 0.25).collect();
            scene.velocities = (0..8)
                .map(|index| (direction(&mut chance) * spread - at(index)) * chance.between(0.0, 1.5))
                .collect();
            for _ in 0..5 {
                let (momentum, energy) = (scene.momentum(), scene.energy());
                touches += scene.advance().count_ones();
                let lost = (scene.momentum() - momentum).norm();
                assert!(lost < 2e-5, "{engine:?}: momentum changed by {lost} kg m/s of {momentum}");
                gains = gains.max(scene.energy() / energy - 1.0);
            }
        }
        assert!(touches > 20_000, "{engine:?}: only {touches} touches were seen");
        println!("{engine:?}: energy gained in a period: at most {:.4} %", 100.0 * gains);
        assert!(gains < 1e-3, "{engine:?}: a share of {gains} of the energy was gained");
    }
}

#[test]
fn the_heavier_pushes_the_lighter() {
    let mut robots = Scenario::default().robots[..2].to_vec();
    (robots[0].mass_kg, robots[1].mass_kg) = (4.0, 0.5);
    let mut scenario = Scenario { robots, ..Scenario::default() };
    scenario.tasks.truncate(1);
    scenario.tasks[0].needs = vec!["food".into()].into();
    let cases = [((1.0, 0.0), 4.0 / 4.5), ((0.0, -1.0), -0.5 / 4.5), ((1.0, -1.0), 3.5 / 4.5)];
    for (engine, (speeds, common)) in ENGINES.iter().flat_map(|engine| cases.map(|case| (*engine, case))) {
        let at = [Vec2::new(-0.08, 0.0), Vec2::new(0.08, 0.0)];
        let velocities = [Vec2::new(speeds.0, 0.0), Vec2::new(speeds.1, 0.0)];
        let mut scene = Scene::new(Scenario { engine, ..scenario.clone() }, &at, &velocities);
        for _ in 0..3 {
            scene.advance();
        }
        // Without restitution both go on at their common velocity.
        for velocity in &scene.velocities {
            let off = (velocity.x - common).abs().max(velocity.y.abs());
            assert!(off < if engine == Engine::Discs { 1e-6 } else { 0.02 }, "{velocity} for {common}");
        }
    }
}

/// The default team's first and third robot meet as told; the two others press upon each other all the
/// while, so that the engine is at work in every substep.
fn meeting(engine: Engine, substeps: u32, positions: [Vec2; 2], velocities: [Vec2; 2]) -> Scene {
    let scenario = Scenario { engine, substeps, ..Scenario::default() };
    let busy = [Vec2::new(0.8, 0.78), Vec2::new(0.8, 0.88)];
    Scene::new(
        scenario,
        &[positions[0], busy[0], positions[1], busy[1]],
        &[velocities[0], Vec2::new(0.0, 1.0), velocities[1], Vec2::new(0.0, -1.0)],
    )
}

#[test]
fn near_misses_are_left_alone() {
    for engine in ENGINES {
        let mut chance = chance(4);
        let (passes, mut deflected) = (4000, 0);
        for _ in 0..passes {
            let miss = 0.05 * chance.between(2.2, 3.0);
            let (at, velocities) = pass(miss, chance.between(0.05, 0.15), (1.0, 1.5), &mut chance);
            let mut scene = meeting(engine, 6, at, velocities);
            for _ in 0..2 {
                // The pair that presses goes on pressing.
                (scene.velocities[1], scene.velocities[3]) = (Vec2::new(0.0, 1.0), Vec2::new(0.0, -1.0));
                let touched = scene.advance();
                assert_eq!(touched & 0b1010, 0b1010, "the busy pair must touch");
            }
            let kicks = [scene.velocities[0] - velocities[0], scene.velocities[2] - velocities[1]];
            deflected += usize::from(kicks.iter().any(|kick| kick.norm() > 1e-3));
        }
        println!("{engine:?}: near misses deflected: {:.2} %", 100.0 * deflected as f32 / passes as f32);
        assert!(deflected * 50 < passes, "{engine:?}: {deflected} of {passes} near misses were deflected");
        assert!(engine == Engine::Rapier || deflected == 0, "{deflected}");
    }
}

#[test]
fn glancing_hits_go_on_as_at_96_substeps_and_in_theory() {
    let mut chance = chance(5);
    let mut from_fine: [Vec<f32>; 2] = Default::default();
    let mut from_theory: [Vec<f32>; 2] = Default::default();
    for _ in 0..1000 {
        let miss = 0.1 * chance.between(0.5, 0.98);
        let (at, velocities) = pass(miss, chance.between(0.1, 0.2), (1.0, 1.5), &mut chance);
        let after = |engine, substeps| {
            let mut scene = meeting(engine, substeps, at, velocities);
            for _ in 0..4 {
                scene.advance();
            }
            [scene.velocities[0], scene.velocities[2]]
        };
        let fine = after(Engine::Rapier, 96);
        let theory = struck(at, velocities, 0.1, (1.0, 0.5));
        for (index, engine) in ENGINES.into_iter().enumerate() {
            let found = after(engine, 6);
            for robot in 0..2 {
                let error = |truth: Vec2| (found[robot] - truth).norm() / truth.norm();
                from_fine[index].push(error(fine[robot]));
                from_theory[index].push(error(theory[robot]));
            }
        }
    }
    let (from_fine, from_theory) = (from_fine.map(median), from_theory.map(median));
    for (index, engine) in ENGINES.into_iter().enumerate() {
        println!(
            "{engine:?}: velocity after a glancing hit, median error: {:.3} % of 96 substeps, {:.3} % of theory",
            100.0 * from_fine[index],
            100.0 * from_theory[index]
        );
    }
    assert!(from_fine[0] < 0.15 && from_theory[0] < 0.15, "{from_fine:?} {from_theory:?}");
    assert!(from_fine[1] < 0.015 && from_theory[1] < 1e-4, "{from_fine:?} {from_theory:?}");
}

/// Velocities after two discs have met without friction or restitution: along the line of centres they
/// share their momentum, across it nothing changes.
fn struck(at: [Vec2; 2], velocities: [Vec2; 2], reach: f32, masses: (f32, f32)) -> [Vec2; 2] {
    let (apart, closing) = (at[1] - at[0], velocities[1] - velocities[0]);
    let (a, b, c) = (closing.norm_squared(), apart.dot(&closing), apart.norm_squared() - reach * reach);
    let time = (-b - (b * b - a * c).sqrt()) / a;
    let normal = (apart + closing * time).normalize();
    let impulse = normal * (closing.dot(&normal) * masses.0 * masses.1 / (masses.0 + masses.1));
    [velocities[0] + impulse / masses.0, velocities[1] - impulse / masses.1]
}

#[test]
fn a_step_of_discs_ends_whatever_the_speed_limits() {
    let team = |count| [Scenario::default().robots, mixed_team(count)];
    let mut chance = chance(12);
    for (case, robots) in [4, 8, 16].into_iter().flat_map(team).enumerate() {
        let obstacles = if case % 2 == 0 { vec![] } else { some_obstacles() };
        let count = robots.len();
        let scenario = Scenario { engine: Engine::Discs, robots, obstacles, ..Scenario::default() };
        let rules = Rules::new(scenario).expect("a valid scenario");
        let (mut workspace, mut events) = (Workspace::default(), Events::default());
        for limit in [-1.0, -0.01, -30.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38, -1e38] {
            for stream in 0..100 {
                let mut world = World::new(&rules, 0, stream);
                let mut levels = vec![HEALTHY; count];
                for level in &mut levels {
                    if stream % 2 == 0 || chance.below(2) == 0 {
                        level[Kind::SpeedLimit as usize] = limit;
                    }
                }
                world.set_faults(&rules, &levels);
                for _ in 0..40 {
                    let actions: Vec<i64> = (0..count).map(|_| 1 + chance.below(4) as i64).collect();
                    let commands = Commands::Discrete(&actions);
                    let (mut components, mut reward) = (vec![0.0; count * NUM_COMPONENTS], vec![0.0; count]);
                    world.step(
                        &rules,
                        &mut workspace,
                        commands,
                        0,
                        &mut events,
                        &mut components,
                        &mut reward,
                    );
                }
            }
        }
    }
}
