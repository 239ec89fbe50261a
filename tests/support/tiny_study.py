"""A study of six runs that take a second each, and a search of such runs."""

TINY = """
question = "Does inner attention matter?"

[grid]
methods = ["ppo-inner", "ppo-uniform"]
budgets = ["quick"]
seeds = "0..2"

[[variants]]
name = "tiny"
train.env_steps = 192
train.num_envs = 8
train.log_every_env_steps = 48
train.checkpoint_every_env_steps = 48
train.compile = "off"
network.hidden_width = 16
network.attention_heads = 2
ppo.rollout_steps = 6
evaluate.episodes = 2
evaluate.score_episodes = 3
evaluate.long_episodes = 2
evaluate.long_episode_steps = 30

[[contrasts]]
name = "inner attention"
a = { method = "ppo-inner" }
b = { method = "ppo-uniform" }
measure = "rescues_per_episode"
margin = 0.5
"""

SEARCHED = """
question = "Which learning rate?"

[grid]
methods = ["ppo-inner"]
budgets = ["quick"]
seeds = "0..2"
train.env_steps = [192]
train.num_envs = [8]
train.compile = ["off"]
network.hidden_width = [16]
network.attention_heads = [2]
ppo.rollout_steps = [6]
evaluate.episodes = [2]
evaluate.score_episodes = [3]
evaluate.long_episodes = [2]
evaluate.long_episode_steps = [30]

[search]
trials = 4
confirm = [10, 11, 12]
ppo.learning_rate = { low = 0.0001, high = 0.1, log = true }
"""
