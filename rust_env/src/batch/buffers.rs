//! The flat arrays that a step writes, and how they are split between shards.

use crate::reward::NUM_COMPONENTS;

/// Where a step writes: one buffer for each array, C order.
pub struct StepBuffers<'a> {
    /// Observations after the step and any autoreset, E × R × D.
    pub obs: &'a mut [f32],
    /// Observations after the step, before any autoreset, E × R × D.
    pub final_obs: &'a mut [f32],
    /// Rewards, E × R.
    pub reward: &'a mut [f32],
    /// Rewards by component, E × R × C.
    pub components: &'a mut [f32],
    /// Whether the scenario's goal ended the episode, E.
    pub terminated: &'a mut [bool],
    /// Whether time ended the episode, E.
    pub truncated: &'a mut [bool],
}

impl StepBuffers<'_> {
    /// Splits off the first `envs` worlds' part.
    pub(super) fn split(self, envs: usize, robots: usize, width: usize) -> (Self, Self) {
        let rows = envs * robots;
        let (obs, obs_rest) = self.obs.split_at_mut(rows * width);
        let (final_obs, final_obs_rest) = self.final_obs.split_at_mut(rows * width);
        let (reward, reward_rest) = self.reward.split_at_mut(rows);
        let (components, components_rest) = self.components.split_at_mut(rows * NUM_COMPONENTS);
        let (terminated, terminated_rest) = self.terminated.split_at_mut(envs);
        let (truncated, truncated_rest) = self.truncated.split_at_mut(envs);
        (
            Self { obs, final_obs, reward, components, terminated, truncated },
            Self {
                obs: obs_rest,
                final_obs: final_obs_rest,
                reward: reward_rest,
                components: components_rest,
                terminated: terminated_rest,
                truncated: truncated_rest,
            },
        )
    }
}
