//! Forged images, with a right checksum: refused, or the state of worlds that go on.

use super::*;
use crate::fault::{Fault, KINDS};
use crate::reward::NUM_COMPONENTS;
use crate::rng::{Purpose, Stream};
use crate::scenario::{Deadline, Engine, Scenario, Situation};

const CHECKSUM_BYTES: usize = 4;

fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = crc32fast::hash(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

/// A batch of worlds in which everything happens, after some steps.
fn played(engine: Engine, steps: usize) -> Batch {
    let robots = Scenario::default().robots;
    let faults = robots.iter().flat_map(|robot| {
        KINDS.map(|kind| Fault {
            robot: robot.name.clone(),
            kind,
            value: 0.4,
            onset_step: 1,
            onset_rate_hz: Some(1.0),
            duration_steps: Some(3),
        })
    });
    let mut tasks = Scenario::default().tasks;
    tasks[0].service_s = 0.3;
    tasks[0].after = vec!["task_2".into()];
    tasks[1].deadline_s = Some(Deadline::Between([0.5, 2.0]));
    tasks[1].area_m = Some([-0.4, -0.4, 0.4, 0.0]);
    let scenario = Scenario {
        engine,
        tasks,
        faults: faults.collect(),
        situation: Situation::Double,
        arena_half_width_m: 0.5,
        spawn_clearance_m: 0.1,
        ..Scenario::default()
    };
    let options =
        Options { num_envs: 2, seed: 1, num_threads: Some(1), first_env: 0, autoreset: Autoreset::SameStep };
    let mut batch = Batch::new(Rules::new(scenario).expect("a valid scenario"), options).expect("a batch");
    let mut chance = Stream::new(3, 0, 0, Purpose::Start);
    for _ in 0..steps {
        step(&mut batch, &mut chance);
        let image = batch.snapshot();
        assert!(image.len() <= snapshot::most_bytes(batch.rules(), 2));
        batch.restore(&image).expect("what was played is a state of these rules");
    }
    batch
}

fn step(batch: &mut Batch, chance: &mut Stream) {
    let (robots, width) = (batch.rules().team.len(), batch.rules().layout.width());
    let envs = batch.num_envs();
    let actions: Vec<i64> = (0..envs * robots).map(|_| chance.below(5) as i64).collect();
    let buffers = StepBuffers {
        obs: &mut vec![0.0; envs * robots * width],
        final_obs: &mut vec![0.0; envs * robots * width],
        reward: &mut vec![0.0; envs * robots],
        components: &mut vec![0.0; envs * robots * NUM_COMPONENTS],
        terminated: &mut vec![false; envs],
        truncated: &mut vec![false; envs],
    };
    batch.step(Commands::Discrete(&actions), buffers).expect("worlds that go on");
}

#[test]
fn a_forged_image_is_refused_or_a_state_from_which_worlds_go_on() {
    for engine in [Engine::Rapier, Engine::Discs, Engine::None] {
        let mut batch = played(engine, 40);
        let image = batch.snapshot();
        let worlds_from = image.len() - CHECKSUM_BYTES - 2 * (image.len() / 3).min(600);
        let mut chance = Stream::new(4, 0, 0, Purpose::Start);
        let (mut accepted, mut refused) = (0, 0);
        for _ in 0..20_000 {
            let mut forged = image[..image.len() - CHECKSUM_BYTES].to_vec();
            let bytes = forged.len();
            for _ in 0..=chance.below(3) {
                let at = worlds_from + chance.below(bytes - worlds_from);
                forged[at] = if chance.below(2) == 0 {
                    forged[at] ^ (1 << chance.below(8))
                } else {
                    chance.below(256) as u8
                };
            }
            match batch.restore(&sealed(forged)) {
                Ok(()) => {
                    accepted += 1;
                    (0..3).for_each(|_| step(&mut batch, &mut chance));
                    batch.worlds().for_each(|world| {
                        assert!(world.positions.iter().all(|at| at.amax() <= 0.5), "{world:?}");
                    });
                }
                Err(_) => refused += 1,
            }
        }
        println!("{engine:?}: {accepted} forged images accepted, {refused} refused");
        assert!(accepted > 100 && refused > 1000, "{accepted} {refused}");
    }
}
