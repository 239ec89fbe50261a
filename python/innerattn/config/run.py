"""Everything that a training run needs, in seven sections; a run is repeated from it alone.

Ranges of the sections below live here; those of a scenario live in the compiled module.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple, Self

from pydantic import BaseModel, Field, model_validator

from innerattn.config.files import preset_names
from innerattn.config.model import Model
from innerattn.config.scenario import Scenario
from innerattn.errors import ConfigError

BUDGETS = preset_names("budgets")
"""Names of the built-in budgets: how long to train, and with which numbers."""

MOST_ROWS = 1_000_000_000
"""Of anything that is held in memory: far beyond what any machine holds."""
MOST_STEPS = 1_000_000_000_000_000
"""Of anything that is counted in steps."""

Method = Literal["td-inner", "td-uniform", "ppo-inner", "ppo-uniform", "mappo"]
Attention = Literal["inner", "uniform", "none"]
WarmStart = Literal["none", "hungarian", "greedy"]


class _Kind(NamedTuple):
    """What a method is: its algorithm, and the values it needs, by section and key."""

    on_policy: bool
    needs: dict[str, dict[str, object]]


_KINDS = {
    "td-inner": _Kind(False, {"network": {"attention": "inner"}}),
    "td-uniform": _Kind(False, {"network": {"attention": "uniform"}}),
    "ppo-inner": _Kind(True, {"network": {"attention": "inner"}}),
    "ppo-uniform": _Kind(True, {"network": {"attention": "uniform"}}),
    "mappo": _Kind(
        True,
        {
            "network": {"attention": "none", "mask_unavailable": False, "encoder": "flat"},
            "ppo": {"advantage": "value"},
        },
    ),
}


def on_policy(method: object) -> bool:
    """Whether a method learns by PPO; what is no method does not."""
    kind = _KINDS.get(str(method))
    return kind is not None and kind.on_policy


class NetworkConfig(Model):
    """Sizes and kind of the networks."""

    place: ClassVar[str] = "network"

    hidden_width: int = Field(128, ge=1, le=4096, description="width of encodings and layers")
    attention_heads: int = Field(4, ge=1, le=64, description="attention heads of the critic")
    attention: Attention = Field(
        "inner",
        description="learnt, fixed at 1/(N-1), or none; follows from the method",
    )
    mask_unavailable: bool = Field(
        False, description="keep unavailable teammates out of the attention"
    )
    encoder: Literal["flat", "entities"] = Field(
        "flat",
        description="first layer of actors and critic: of whole observations, or of teammates and "
        "victims apart, whatever their order; mappo needs the former",
    )
    parameter_sharing: Literal["none", "kind"] = Field(
        "none",
        description="none: actors, encoders and critics are each robot's own; kind: robots of a "
        "kind have the same, but for a critic without attention",
    )
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="of the products in an update; weights are float32 in any case"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.hidden_width % self.attention_heads:
            raise ValueError(
                f"network.hidden_width = {self.hidden_width}: must be a multiple of "
                f"network.attention_heads = {self.attention_heads}"
            )
        return self


class TDConfig(Model):
    """Off-policy, maximum-entropy actor-critic learning from a replay memory."""

    place: ClassVar[str] = "td"

    gamma: float = Field(0.95, ge=0.0, le=1.0, description="discount per control step")
    polyak: float = Field(
        0.02, gt=0.0, le=1.0, description="step of the target networks towards the trained ones"
    )
    reward_scale: float = Field(
        10.0, gt=0.0, description="1/temperature: higher rewards less randomness"
    )
    learning_rate: float = Field(0.002, gt=0.0, le=1.0, description="step size of Adam")
    final_learning_rate_share: float = Field(
        0.05,
        ge=0.0,
        le=1.0,
        description="share of the step size left at the end of training; it falls evenly",
    )
    batch_size: int = Field(256, ge=1, le=MOST_ROWS, description="transitions per update")
    update_every_env_steps: int = Field(
        50,
        ge=1,
        le=MOST_STEPS,
        description="one update per so many steps, all worlds counted [env-steps]",
    )
    warmup_env_steps: int = Field(
        1_000,
        ge=0,
        le=MOST_STEPS,
        description="steps collected before the first update [env-steps]",
    )
    replay_capacity: int = Field(
        200_000, ge=1, le=MOST_ROWS, description="size of the replay memory"
    )
    attention_logit_penalty: float = Field(
        0.0, ge=0.0, description="weight of the squared attention logits in the critic's loss"
    )
    critic_weight_decay: float = Field(0.0, ge=0.0, description="L2 penalty of the critic's Adam")
    critic_grad_clip: float = Field(40.0, gt=0.0, description="largest norm of critic gradients")
    actor_grad_clip: float = Field(0.5, gt=0.0, description="largest norm of an actor's gradients")
    policy_gradient: Literal["expected", "sampled"] = Field(
        "expected", description="exact expectation over the own action, or one sample"
    )
    entropy_target: Literal["consistent", "maac"] = Field(
        "consistent",
        description="entropy term of the target: discounted and masked with the value, or as in "
        "the MAAC reference",
    )
    reward_std_floor: float = Field(
        1e-2, gt=0.0, description="least deviation that rewards are divided by"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.replay_capacity < self.batch_size:
            raise ValueError(
                f"td.replay_capacity = {self.replay_capacity}: must be at least "
                f"td.batch_size = {self.batch_size}"
            )
        return self


class PPOConfig(Model):
    """On-policy learning by proximal policy optimisation."""

    place: ClassVar[str] = "ppo"

    gamma: float = Field(0.95, ge=0.0, le=1.0, description="discount per control step")
    gae_lambda: float = Field(
        0.9, ge=0.0, le=1.0, description="how far advantages look: 0 one step, 1 to the end"
    )
    learning_rate: float = Field(0.003, gt=0.0, le=1.0, description="step size of Adam")
    final_learning_rate_share: float = Field(
        0.1,
        ge=0.0,
        le=1.0,
        description="share of the step size left at the end of training; it falls evenly",
    )
    rollout_steps: int = Field(
        25, ge=1, le=MOST_ROWS, description="control steps of every world between updates [steps]"
    )
    epochs: int = Field(5, ge=1, le=1_000, description="passes over a rollout")
    minibatch_size: int = Field(400, ge=1, le=MOST_ROWS, description="rows of a rollout per update")
    clip: float = Field(0.2, gt=0.0, lt=1.0, description="how far a probability ratio counts")
    value_clip: float | None = Field(
        None, gt=0.0, description="how far a value may move per rollout; None: freely"
    )
    entropy_weight: float = Field(0.01, ge=0.0, description="weight of the policy's entropy")
    stop_at_kl: float | None = Field(
        None, gt=0.0, description="divergence that ends a rollout's epochs [nats]; None: none does"
    )
    advantage: Literal["counterfactual", "value"] = Field(
        "counterfactual",
        description="baseline: expectation of Q over the own action, or a value head; mappo needs "
        "the latter",
    )
    attention_logit_penalty: float = Field(
        0.0, ge=0.0, description="weight of the squared attention logits in the critic's loss"
    )
    critic_weight_decay: float = Field(0.0, ge=0.0, description="L2 penalty of the critic's Adam")
    critic_grad_clip: float = Field(40.0, gt=0.0, description="largest norm of critic gradients")
    actor_grad_clip: float = Field(0.5, gt=0.0, description="largest norm of an actor's gradients")
    return_deviation_floor: float = Field(
        1e-2, gt=0.0, description="least deviation of returns that rewards are divided by"
    )


class ImitationConfig(Model):
    """How a warm start imitates a scripted policy, before anything is learnt from rewards."""

    place: ClassVar[str] = "imitation"

    env_steps: int = Field(
        750_000,
        ge=1,
        le=MOST_STEPS,
        description="length of imitation, all worlds counted [env-steps]",
    )
    critic_env_steps: int = Field(
        100_000,
        ge=0,
        le=MOST_STEPS,
        description="last part of it in which the critic learns too [env-steps]",
    )
    batch_size: int = Field(
        1_024, ge=1, le=MOST_ROWS, description="labelled states per step of the actors"
    )
    update_every_env_steps: int = Field(
        256, ge=1, le=MOST_STEPS, description="one step of the actors per so many steps [env-steps]"
    )
    learning_rate: float = Field(0.002, gt=0.0, le=1.0, description="step size of Adam")
    final_learning_rate_share: float = Field(
        0.02,
        ge=0.0,
        le=1.0,
        description="share of the step size left at the end of imitation; it falls evenly",
    )
    memory_env_steps: int = Field(
        500_000,
        ge=1,
        le=MOST_ROWS,
        description="newest labelled states that batches are drawn from [env-steps]",
    )


class TrainConfig(Model):
    """How long to train, where, and how often to log."""

    place: ClassVar[str] = "train"

    method: Method = Field("td-inner", description="learning algorithm and kind of critic")
    warm_start: WarmStart = Field(
        "none", description="scripted policy to imitate before learning from rewards"
    )
    seed: int = Field(0, ge=0, lt=2**63, description="seed of everything random")
    device: str = Field("cpu", description="where networks run: cpu, cuda, cuda:0, ...")
    threads: int | None = Field(
        None,
        ge=1,
        le=256,
        description="threads of worlds and networks; None: as many as are worth it",
    )
    compile: Literal["auto", "on", "off"] = Field(
        "auto", description="compile the update before training; auto: where the run is long enough"
    )
    num_envs: int = Field(64, ge=1, le=1_000_000, description="worlds stepped side by side")
    env_steps: int = Field(
        150_000,
        ge=1,
        le=MOST_STEPS,
        description="length of learning from rewards, all worlds counted [env-steps]",
    )
    log_every_env_steps: int = Field(
        5_000, ge=1, le=MOST_STEPS, description="one line of metrics per so many steps [env-steps]"
    )


class EvaluateConfig(Model):
    """How a policy is measured."""

    place: ClassVar[str] = "evaluate"

    episodes: int = Field(
        80, ge=1, le=1_000_000, description="episodes that cooperation is counted over"
    )
    score_episodes: int = Field(
        1_000, ge=2, le=1_000_000, description="episodes that rescues are averaged over"
    )
    long_episodes: int = Field(200, ge=2, le=1_000_000, description="episodes of the second length")
    long_episode_steps: int = Field(
        100, ge=1, le=100_000, description="second episode length [control steps]"
    )
    greedy_actions: bool = Field(
        True, description="take the likeliest action instead of drawing one"
    )
    seed: int = Field(12_345, ge=0, lt=2**63, description="seed of the evaluation's worlds")


def refuse_late_faults(scenario: Scenario, evaluate: EvaluateConfig) -> None:
    """Refuse to measure worlds whose faults begin after episodes of the second length.

    Raises:
        ConfigError: one does; the message names it.
    """
    longest = evaluate.long_episode_steps
    for index, fault in enumerate(scenario.faults):
        if fault.onset_step >= longest:
            raise ConfigError(
                f"scenario.faults[{index}].onset_step = {fault.onset_step}: must be below "
                f"evaluate.long_episode_steps = {longest}, a length that is measured, too"
            )


class RunConfig(Model):
    """A whole run. What `train.method` needs follows from it where it is not given.

    Raises:
        pydantic.ValidationError: (a `ValueError`) unknown key, wrong type, value out of range, or
            values that contradict each other; the message names the key and what is allowed.
    """

    scenario: Scenario = Field(default_factory=Scenario, description="the world")
    network: NetworkConfig = Field(default_factory=NetworkConfig, description="the networks")
    td: TDConfig = Field(default_factory=TDConfig, description="numbers of the TD methods")
    ppo: PPOConfig = Field(default_factory=PPOConfig, description="numbers of the PPO methods")
    imitation: ImitationConfig = Field(
        default_factory=ImitationConfig, description="numbers of a warm start"
    )
    train: TrainConfig = Field(default_factory=TrainConfig, description="the run")
    evaluate: EvaluateConfig = Field(default_factory=EvaluateConfig, description="measuring")

    def in_use(self) -> dict[str, dict[str, Any]]:
        """The values that the run depends on, as JSON values by section and key.

        Numbers of the other algorithm, and those of a warm start where there is none, are left out.
        """
        unused = {"td" if on_policy(self.train.method) else "ppo"}
        if self.train.warm_start == "none":
            unused.add("imitation")
        return self.model_dump(mode="json", exclude=unused)

    def digest(self) -> str:
        """SHA-256, in hexadecimal, of the values `in_use` as JSON with sorted keys.

        It does not depend on how a file writes them or on keys that it leaves to their defaults.
        """
        text = json.dumps(self.in_use(), sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    @model_validator(mode="before")
    @classmethod
    def _follow_method(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        kind = _KINDS.get(str(_given(data.get("train")).get("method")))
        for section, values in kind.needs.items() if kind else ():
            if isinstance(data.get(section, {}), Mapping | BaseModel):  # else its own check says so
                data = {**data, section: {**values, **_given(data.get(section))}}
        return data

    @model_validator(mode="after")
    def _check(self) -> Self:
        method = self.train.method
        for section, values in _KINDS[method].needs.items():
            for key, wanted in values.items():
                value = getattr(getattr(self, section), key)
                if value != wanted:
                    raise ValueError(
                        f"{section}.{key} = {value!r}: train.method = {method!r} needs {wanted!r}"
                    )
        refuse_late_faults(self.scenario, self.evaluate)
        section = "ppo" if on_policy(method) else "td"
        gamma, world = getattr(self, section).gamma, self.scenario
        if world.shaping == "potential" and world.shaping_discount != gamma:
            raise ValueError(
                f"scenario.shaping_discount = {world.shaping_discount!r}: potential shaping leaves "
                f"the best policy as it is only with the learner's {section}.gamma = {gamma!r}"
            )
        return self


def _given(section: object) -> Mapping[str, Any]:
    """What a section (a table or a model) sets."""
    if isinstance(section, BaseModel):
        return section.model_dump(exclude_unset=True)
    return section if isinstance(section, Mapping) else {}
