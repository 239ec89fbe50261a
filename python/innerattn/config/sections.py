"""Sections of a run's configuration that every algorithm shares.

Ranges of these sections live here; those of a scenario live in the compiled module.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from innerattn.config.model import ADDED_LATER, MOST_ROWS, MOST_STEPS, Model, OneOf
from innerattn.config.registry import attentions, methods
from innerattn.config.schedule import ScheduleConfig

Method = Annotated[str, OneOf(methods)]
Attention = Annotated[str, OneOf(lambda: (*attentions(), "none"))]
WarmStart = Literal["none", "hungarian", "greedy", "planner"]
Pooling = Literal["attention", "mean", "max", "nearest"]
Script = Literal["none", "random", "greedy", "hungarian", "planner", "oracle", "greedy-seen"]


class NetworkConfig(Model):
    """Sizes and kind of the networks."""

    place: ClassVar[str] = "network"

    hidden_width: int = Field(128, ge=1, le=4096, description="width of encodings and layers")
    attention_heads: int = Field(4, ge=1, le=64, description="attention heads of the critic")
    attention: Attention = Field(
        "inner",
        description="inner: learnt; uniform: 1/(N-1); frozen: as drawn, untrained; oracle: all on "
        "the partners that the first victim needs; max: the largest of each feature; independent: "
        "no teammates; none: one network over all observations; follows from the method",
    )
    mask_unavailable: bool = Field(
        False, description="keep unavailable teammates out of the attention"
    )
    encoder: Literal["flat", "entities"] = Field(
        "flat",
        description="first layer of actors and critic: flat takes the whole observation; entities "
        "encodes teammates and victims separately, in any order; mappo needs flat",
    )
    pooling: Annotated[Pooling, ADDED_LATER] = Field(
        "attention",
        description="what the encoder entities makes of the teammates and of the victims that are "
        "there: their sum with learnt weights, their mean, the largest of each number, or the "
        "nearest one",
    )
    parameter_sharing: Literal["none", "kind"] = Field(
        "none",
        description="none: every robot has its own actor, encoders and critic; kind: robots of a "
        "kind share them, except a critic without attention",
    )
    mask_actions: Annotated[bool, ADDED_LATER] = Field(
        False,
        description="let a robot that cannot act, because it is unavailable or has no charge, stay "
        "for certain, so that nothing is learnt from actions without an effect",
    )
    swapped_robots: Annotated[tuple[str, str] | None, ADDED_LATER] = Field(
        None,
        description="names of two robots of a kind that swap their initial weights, to see what "
        "the weights of a seed decide; needs robots with parameters of their own",
    )
    shared_gradients: Annotated[Literal["sum", "mean"], ADDED_LATER] = Field(
        "sum",
        description="gradient of layers that robots of a kind share: the sum of the robots' "
        "gradients, or their mean; that of the attention is always the mean",
    )
    joint_critic: Annotated[Literal["per_robot", "central"], ADDED_LATER] = Field(
        "per_robot",
        description="critic without attention: per_robot: a network for each robot; central: one "
        "network with an output for each robot",
    )
    symmetry: Annotated[Literal["none", "canonical", "augmented"], ADDED_LATER] = Field(
        "none",
        description="none: observations as they are; canonical: each turned and mirrored so that "
        "its first victim lies at x >= y >= 0, and actions turned back; augmented: worlds turned "
        "at random in training",
    )
    memory_width: Annotated[int, ADDED_LATER] = Field(
        0,
        ge=0,
        le=1_024,
        multiple_of=4,
        description="numbers that a robot remembers from step to step of an episode, in a gated "
        "recurrent unit before actor and critic; 0: no memory; PPO methods only",
    )
    message_width: Annotated[int, ADDED_LATER] = Field(
        0,
        ge=0,
        le=1_024,
        multiple_of=4,
        description="numbers of the message that each robot's policy learns to send in each step "
        "to those who hear it; 0: no messages; PPO methods only",
    )
    message_pooling: Annotated[Pooling, ADDED_LATER] = Field(
        "attention",
        description="what a robot makes of the messages it hears: their sum with learnt weights, "
        "their mean, the largest of each number, or that of the nearest robot",
    )
    precision: Literal["float32", "bfloat16"] = Field(
        "float32", description="of matrix products in an update; weights are always float32"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.hidden_width % self.attention_heads:
            raise ValueError(
                f"network.hidden_width = {self.hidden_width}: must be a multiple of "
                f"network.attention_heads = {self.attention_heads}"
            )
        if self.pooling != "attention" and self.encoder != "entities":
            raise ValueError(
                f"network.pooling = {self.pooling!r}: network.encoder = {self.encoder!r} pools "
                "nothing; must be 'attention', or the encoder 'entities'"
            )
        return self


class ImitationConfig(Model):
    """How a warm start imitates a scripted policy, before anything is learnt from rewards."""

    place: ClassVar[str] = "imitation"

    env_steps: int = Field(
        750_000,
        ge=1,
        le=MOST_STEPS,
        description="length of imitation, summed over worlds [env-steps]",
    )
    critic_env_steps: int = Field(
        100_000,
        ge=0,
        le=MOST_STEPS,
        description="last part of the imitation, in which the critic learns too [env-steps]",
    )
    batch_size: int = Field(
        1_024, ge=1, le=MOST_ROWS, description="labelled states per step of the actors"
    )
    update_every_env_steps: int = Field(
        256,
        ge=1,
        le=MOST_STEPS,
        description="steps of all worlds per step of the actors [env-steps]",
    )
    learning_rate: float = Field(0.002, gt=0.0, le=1.0, description="step size of Adam")
    final_learning_rate_share: float = Field(
        0.02,
        ge=0.0,
        le=1.0,
        description="share of the step size left at the end of imitation; it falls linearly",
    )
    memory_env_steps: int = Field(
        500_000,
        ge=1,
        le=MOST_ROWS,
        description="newest labelled states that batches are drawn from [env-steps]",
    )


_MOST_WORKERS = 256


def _auto_or_workers(value: object) -> object:
    if value == "auto" or (type(value) is int and 1 <= value <= _MOST_WORKERS):
        return value
    raise PydanticCustomError("workers", f"Input should be 'auto' or 1 to {_MOST_WORKERS}")


_Workers = Annotated[
    Literal["auto"] | Annotated[int, Field(ge=1, le=_MOST_WORKERS)],
    BeforeValidator(_auto_or_workers),
]


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
        description="threads of worlds and networks; None: as many as pay",
    )
    workers: Annotated[_Workers, ADDED_LATER] = Field(
        1,
        description="processes that train together, each in its share of the worlds, with "
        "train.threads or one thread each; auto: as many as pay here, one if threads is given",
    )
    compile: Literal["auto", "on", "off"] = Field(
        "auto", description="compile the update before training; auto: if the run is long enough"
    )
    matmul_backend: Annotated[Literal["auto", "default"], ADDED_LATER] = Field(
        "auto",
        description="what multiplies matrices on a CPU; auto: oneDNN on AMD processors with "
        "AVX-512, where it is faster; default: PyTorch's own choice",
    )
    num_envs: int = Field(64, ge=1, le=1_000_000, description="worlds stepped side by side")
    env_steps: int = Field(
        150_000,
        ge=0,
        le=MOST_STEPS,
        description="length of learning from rewards, summed over worlds [env-steps]; 0: none, "
        "after a warm start of a policy for any team",
    )
    log_every_env_steps: int = Field(
        5_000,
        ge=1,
        le=MOST_STEPS,
        description="steps of all worlds per line of metrics [env-steps]",
    )
    checkpoint_every_env_steps: Annotated[int, ADDED_LATER] = Field(
        250_000,
        ge=0,
        le=MOST_STEPS,
        description="steps of all worlds per checkpoint [env-steps]; 0: by time alone",
    )
    checkpoint_every_minutes: Annotated[float, ADDED_LATER] = Field(
        1.0,
        ge=0.0,
        description="longest time between checkpoints [min]; 0: by env-steps alone",
    )
    keep_checkpoints: Annotated[int, ADDED_LATER] = Field(
        2, ge=1, le=1_000, description="newest checkpoints that stay during training"
    )
    on_divergence: Annotated[Literal["stop", "skip"], ADDED_LATER] = Field(
        "stop",
        description="an update with a loss or gradient that is not finite: stop training before "
        "it, or skip it; metrics count skipped_updates",
    )
    keep_best: Annotated[bool, ADDED_LATER] = Field(
        True,
        description="keep the weights of the logging interval with the most rescues per env-step, "
        "too",
    )
    episode_steps: Annotated[int | None, ADDED_LATER] = Field(
        None,
        ge=1,
        le=MOST_STEPS,
        description="length of an episode in training [control steps]; None: the scenario's",
    )
    engine: Annotated[Literal["rapier", "discs"] | None, ADDED_LATER] = Field(
        None, description="contacts in training; None: the scenario's"
    )
    stagger_starts: Annotated[bool, ADDED_LATER] = Field(
        False, description="let worlds begin their episodes at different times"
    )
    schedule: Annotated[ScheduleConfig, ADDED_LATER] = Field(
        default_factory=ScheduleConfig, description="what changes in the course of the run"
    )
    potential: Annotated[Script, ADDED_LATER] = Field(
        "none",
        description="scripted policy whose value function shapes rewards, as a potential that is "
        "fitted to the script's play before training",
    )
    potential_discount: Annotated[float | None, ADDED_LATER] = Field(
        None,
        ge=0.0,
        lt=1.0,
        description="discount of a control step in the potential; None: the learner's gamma, with "
        "which the best policy stays the best; any other biases what is learnt",
    )
    potential_env_steps: Annotated[int, ADDED_LATER] = Field(
        100_000,
        ge=1_000,
        le=MOST_ROWS,
        description="length of the script's play that the potential is fitted to, summed over "
        "worlds [env-steps]",
    )


class EvaluateConfig(Model):
    """How a policy is measured."""

    place: ClassVar[str] = "evaluate"

    episodes: int = Field(
        80, ge=1, le=1_000_000, description="episodes in which cooperation is counted"
    )
    score_episodes: int = Field(
        1_000, ge=2, le=1_000_000, description="episodes that rescues are averaged over"
    )
    long_episodes: int = Field(200, ge=2, le=1_000_000, description="episodes of the second length")
    long_episode_steps: int = Field(
        100, ge=1, le=100_000, description="second episode length [control steps]"
    )
    greedy_actions: bool = Field(
        True, description="take the most likely action instead of drawing one"
    )
    seed: int = Field(12_345, ge=0, lt=2**63, description="seed of the evaluation's worlds")
