"""One policy for any team ("team"): its numbers and what it registers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from innerattn.config.algorithm import Algorithm, AlgorithmConfig
from innerattn.config.files import PRESETS
from innerattn.config.model import ADDED_LATER, MOST_ROWS


class TeamConfig(AlgorithmConfig):
    """Learning of one policy for any team, whose networks know no names and no number of robots."""

    place: ClassVar[str] = "team"
    for_any_team: ClassVar[bool] = True
    removed: ClassVar[Mapping[str, object]] = {}

    gamma: float = Field(0.98, ge=0.0, le=1.0, description="discount per control step")
    pooling: Literal["inner", "uniform", "max", "nearest"] = Field(
        "inner",
        description="how a robot sums up its rivals and partners at a victim; inner: learnt "
        "attention; uniform: the mean; max; nearest: the one that is there first; follows from the "
        "method",
    )
    hidden_width: int = Field(48, ge=1, le=4096, description="width of the actor's layers")
    key_width: int = Field(16, ge=1, le=4096, description="width of queries and keys")
    features: Annotated[Literal["all", "plain"], ADDED_LATER] = Field(
        "all",
        description="what a robot knows of a victim; plain: places, speeds, bodies, needs and "
        "abilities; all: also arrival times, and what follows from them and from the law of motion",
    )
    bodies: Annotated[Literal["told", "hidden", "hypernetwork"], ADDED_LATER] = Field(
        "told",
        description="how robots know bodies (speed, start, push); told: by numbers; hidden: not at "
        "all; hypernetwork: a network makes a robot's last layer of its own body. hidden and "
        "hypernetwork need features = 'plain'; what has a hypernetwork cannot be exported",
    )
    teams: int = Field(
        16, ge=1, le=4096, description="teams trained side by side; divides train.num_envs"
    )
    new_teams: int = Field(
        2, ge=0, le=4096, description="teams replaced by new ones after each rollout"
    )
    rollout_steps: int = Field(
        25, ge=1, le=MOST_ROWS, description="control steps of every world between updates [steps]"
    )
    gae_lambda: float = Field(
        0.8, ge=0.0, le=1.0, description="horizon of advantages: 0 is one step, 1 the whole episode"
    )
    learning_rate: float = Field(0.002, gt=0.0, le=1.0, description="step size of Adam")
    final_learning_rate_share: float = Field(
        0.01,
        ge=0.0,
        le=1.0,
        description="share of the step size left at the end of training; it falls linearly",
    )
    clip: float = Field(
        0.2, gt=0.0, lt=1.0, description="largest change of a probability ratio that counts"
    )
    entropy_weight: float = Field(
        0.015, ge=0.0, description="weight of the policy's entropy; train.schedule may change it"
    )
    pull: Annotated[float, ADDED_LATER] = Field(
        0.0,
        ge=0.0,
        description="weight of the cross-entropy to the script's actions while the policy learns "
        "from rewards after a warm start; it falls linearly to 0 at the end of training",
    )

    @model_validator(mode="after")
    def _check_bodies(self) -> Self:
        if self.bodies != "told" and self.features == "all":
            raise ValueError(
                f"team.bodies = {self.bodies!r}: needs team.features = 'plain'; times of arrival "
                "follow from bodies"
            )
        return self

    @property
    def rows_per_update(self) -> int:
        """Rows of a control step; an update is one thread's work."""
        return 1

    def rows_of_training(self, env_steps: int) -> int:
        """Each control step of a world is used once."""
        return env_steps

    @property
    def batches(self) -> Mapping[str, int]:
        """The teams; see `AlgorithmConfig.batches`."""
        return {"teams": self.teams}


TEAM = Algorithm(
    config=TeamConfig,
    learner="innerattn.train.teams.policy:TeamPolicy",
    averages_over_workers=True,
    methods={
        f"team-{pooling}": {"team": {"pooling": pooling}}
        for pooling in ("inner", "uniform", "max", "nearest")
    },
    budgets=PRESETS / "budgets" / "team",
    warm_budgets=PRESETS / "budgets" / "team-warm",
)
