//! What a batch refuses, and how episodes end and begin in it.

use super::*;
use crate::reward::NUM_COMPONENTS;
use crate::scenario::Scenario;

const ENVS: usize = 3;

fn batch(scenario: Scenario, autoreset: Autoreset) -> Batch {
    let options = Options { num_envs: ENVS, seed: 0, num_threads: Some(2), first_env: 0, autoreset };
    Batch::new(Rules::new(scenario).expect("a valid scenario"), options).expect("a batch")
}

type Stepped = (Vec<f32>, Vec<f32>, Vec<bool>, Vec<bool>);

/// Observations, final observations, terminated and truncated of a step.
fn step(batch: &mut Batch, commands: Commands) -> Result<Stepped> {
    let rows = ENVS * batch.rules().team.len();
    let mut obs = vec![0.0; rows * batch.rules().layout.width()];
    let (mut final_obs, mut reward) = (obs.clone(), vec![0.0; rows]);
    let mut components = vec![0.0; rows * NUM_COMPONENTS];
    let (mut terminated, mut truncated) = (vec![false; ENVS], vec![false; ENVS]);
    let buffers = StepBuffers {
        obs: &mut obs,
        final_obs: &mut final_obs,
        reward: &mut reward,
        components: &mut components,
        terminated: &mut terminated,
        truncated: &mut truncated,
    };
    batch.step(commands, buffers)?;
    Ok((obs, final_obs, terminated, truncated))
}

fn refusal(batch: &mut Batch, commands: Commands) -> String {
    let before = batch.snapshot();
    let error = step(batch, commands).expect_err("bad actions").to_string();
    assert!(batch.snapshot() == before, "something moved: {error}");
    error
}

#[test]
fn bad_actions_are_named_and_nothing_moves() {
    let mut discrete = batch(Scenario::default(), Autoreset::SameStep);
    for (index, value) in [(6, 5), (6, -1), (6, i64::MAX)] {
        let mut actions = [1; ENVS * 4];
        actions[index] = value;
        let wanted = format!("actions[env 1, robot 2] = {value}: must be an integer in 0..=4");
        assert_eq!(refusal(&mut discrete, Commands::Discrete(&actions)), wanted);
    }
    assert!(refusal(&mut discrete, Commands::Discrete(&[0; 11])).starts_with("actions = 11 Discrete values"));
    assert!(refusal(&mut discrete, Commands::Continuous(&[0.0; 24])).contains("must be 12 Discrete values"));
    let scenario = Scenario { actions: Actions::Continuous, ..Scenario::default() };
    let mut continuous = batch(scenario, Autoreset::SameStep);
    for value in [f32::NAN, 1.001, f32::NEG_INFINITY] {
        let mut actions = [0.5; ENVS * 8];
        actions[23] = value;
        let wanted = format!("actions[env 2, robot 3] = {value:?} on axis 1: must be a number in -1..=1");
        assert_eq!(refusal(&mut continuous, Commands::Continuous(&actions)), wanted);
    }
}

#[test]
fn the_same_step_shows_the_end_and_the_next_beginning() {
    let mut batch = batch(Scenario { episode_steps: 2, ..Scenario::default() }, Autoreset::SameStep);
    let (obs, final_obs, _, truncated) = step(&mut batch, Commands::Discrete(&[1; 12])).expect("valid");
    assert!(obs == final_obs && truncated == [false; 3]);
    let (obs, final_obs, terminated, truncated) =
        step(&mut batch, Commands::Discrete(&[1; 12])).expect("valid");
    assert!(truncated == [true; 3] && terminated == [false; 3] && obs != final_obs);
    assert!(batch.worlds().all(|world| world.episode == 1 && world.step == 0 && !world.over));
    let mut now = vec![0.0; obs.len()];
    batch.observe(&mut now);
    assert!(obs == now);
}

#[test]
fn without_autoreset_an_ended_world_waits() {
    let mut batch = batch(Scenario { episode_steps: 1, ..Scenario::default() }, Autoreset::Disabled);
    let (mut obs, final_obs, ..) = step(&mut batch, Commands::Discrete(&[1; 12])).expect("valid");
    assert!(obs == final_obs);
    batch.reset(None, Some(&[true, false, true]), &mut obs);
    let error = refusal(&mut batch, Commands::Discrete(&[0; 12]));
    assert!(error.starts_with("env 1: its episode is over"), "{error}");
    batch.reset(None, Some(&[false, true, false]), &mut obs);
    step(&mut batch, Commands::Discrete(&[0; 12])).expect("all were reset");
}

#[test]
fn with_autoreset_in_the_next_step_that_step_begins_the_episode_and_moves_nobody() {
    let scenario = Scenario { episode_steps: 1, action_cost: 1.0, ..Scenario::default() };
    let mut later = batch(scenario.clone(), Autoreset::NextStep);
    let mut same = batch(scenario, Autoreset::SameStep);
    for _ in 0..3 {
        let (obs, final_obs, _, truncated) = step(&mut later, Commands::Discrete(&[1; 12])).expect("valid");
        let (next, last, ..) = step(&mut same, Commands::Discrete(&[1; 12])).expect("valid");
        assert!(obs == last && final_obs == last && truncated == [true; 3]);
        assert!(later.worlds().all(|world| world.over));
        let (obs, final_obs, terminated, truncated) =
            step(&mut later, Commands::Discrete(&[2; 12])).expect("valid");
        assert!(obs == next && final_obs == next && terminated == [false; 3] && truncated == [false; 3]);
        assert!(later.worlds().all(|world| world.step == 0 && !world.over));
    }
}

#[test]
fn a_reset_goes_on_to_the_next_episode_or_starts_over() {
    let mut batch = batch(Scenario::default(), Autoreset::SameStep);
    let mut obs = vec![0.0; ENVS * 4 * batch.rules().layout.width()];
    let episodes = |batch: &Batch| batch.worlds().map(|world| world.episode).collect::<Vec<_>>();
    let made = batch.worlds().next().map(|world| world.positions.clone());
    batch.reset(None, None, &mut obs);
    assert_eq!(episodes(&batch), [0, 0, 0]);
    let first = obs.clone();
    batch.reset(None, Some(&[false, true, false]), &mut obs);
    assert_eq!(episodes(&batch), [0, 1, 0]);
    batch.reset(Some(0), None, &mut obs);
    assert!(episodes(&batch) == [0, 0, 0] && obs == first);
    assert_eq!(batch.worlds().next().map(|world| world.positions.clone()), made);
    batch.reset(Some(1), None, &mut obs);
    assert!(obs != first);
}

#[test]
fn sizes_out_of_range_are_refused() {
    let options = |num_envs, threads| Options {
        num_envs,
        seed: 0,
        num_threads: Some(threads),
        first_env: 0,
        autoreset: Autoreset::SameStep,
    };
    let rules = Arc::new(Rules::new(Scenario::default()).expect("a valid scenario"));
    let refused = |options| Batch::new(Arc::clone(&rules), options).err().map(|error| error.to_string());
    assert_eq!(refused(options(0, 1)).as_deref(), Some("num_envs = 0: must be in 1..=1048576"));
    assert_eq!(refused(options(1, 257)).as_deref(), Some("num_threads = 257: must be in 1..=256"));
}

#[test]
fn only_a_reset_before_the_first_step_keeps_episode_0() {
    let mut batch = batch(Scenario::default(), Autoreset::SameStep);
    let mut obs = vec![0.0; ENVS * batch.rules().team.len() * batch.rules().layout.width()];
    let episodes = |batch: &Batch| batch.worlds().map(|world| world.episode).collect::<Vec<_>>();
    batch.reset(None, None, &mut obs);
    assert_eq!(episodes(&batch), [0; ENVS]);
    batch.reset(None, None, &mut obs);
    assert_eq!(episodes(&batch), [1; ENVS]);
    let mut stepped = self::batch(Scenario::default(), Autoreset::SameStep);
    step(&mut stepped, Commands::Discrete(&[0; ENVS * 4])).expect("good actions");
    stepped.reset(None, None, &mut obs);
    assert_eq!(episodes(&stepped), [1; ENVS]);
}

#[test]
fn a_world_that_panics_stops_no_other() {
    let quick = |batch: &mut Batch| step(batch, Commands::Discrete(&[1; ENVS * 4]));
    let (mut batch, mut plain) = (
        batch(Scenario::default(), Autoreset::SameStep),
        self::batch(Scenario::default(), Autoreset::SameStep),
    );
    batch.panic_in_next_step(vec![1]);
    let error = quick(&mut batch).expect_err("a panic");
    assert_eq!(error, Error::Panicked { envs: vec![1], message: "a test asked for it".into() });
    quick(&mut plain).expect("good actions");
    let worlds = |batch: &Batch| batch.worlds().cloned().collect::<Vec<_>>();
    assert!(worlds(&batch)[0] == worlds(&plain)[0] && worlds(&batch)[2] == worlds(&plain)[2]);
    assert_eq!(worlds(&batch)[1].step, 0);
    assert_eq!(quick(&mut batch), Err(Error::Broken { env: 1 }));
    let mut obs = vec![0.0; ENVS * 4 * batch.rules().layout.width()];
    batch.reset(None, Some(&[true, false, true]), &mut obs);
    assert_eq!(quick(&mut batch), Err(Error::Broken { env: 1 }));
    batch.reset(None, Some(&[false, true, false]), &mut obs);
    quick(&mut batch).expect("all were reset");
}

#[test]
fn an_interrupted_step_moves_nothing() {
    let scenario = Scenario { substeps: 300, ..Scenario::default() };
    let options = Options {
        num_envs: 4096,
        seed: 0,
        num_threads: Some(2),
        first_env: 0,
        autoreset: Autoreset::SameStep,
    };
    let mut batch = Batch::new(Rules::new(scenario).expect("a valid scenario"), options).expect("a batch");
    let mut arrays = (vec![0.0; 4096 * 4 * batch.rules().layout.width()], vec![false; 4096]);
    let (mut final_obs, mut reward) = (arrays.0.clone(), vec![0.0; 4096 * 4]);
    let (mut components, mut truncated) = (vec![0.0; 4096 * 4 * NUM_COMPONENTS], arrays.1.clone());
    let actions = vec![1; 4096 * 4];
    let mut go = |batch: &mut Batch, stop: bool| {
        let buffers = StepBuffers {
            obs: &mut arrays.0,
            final_obs: &mut final_obs,
            reward: &mut reward,
            components: &mut components,
            terminated: &mut arrays.1,
            truncated: &mut truncated,
        };
        batch.step_polled(Commands::Discrete(&actions), buffers, Some(&|| stop)).map(|_| ())
    };
    for _ in 0..20 {
        let before = batch.snapshot();
        if go(&mut batch, true) == Err(Error::Interrupted) {
            assert!(batch.snapshot() == before, "something moved");
            go(&mut batch, false).expect("nobody stops it");
            return assert!(batch.snapshot() != before);
        }
    }
    panic!("no step took long enough to be interrupted");
}
