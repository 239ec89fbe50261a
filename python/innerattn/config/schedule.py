"""What a learner weighs differently in the course of a run ("train.schedule")."""

from __future__ import annotations

from typing import ClassVar, Self

from pydantic import Field, model_validator

from innerattn.config.model import Model


class Ramp(Model):
    """A number that goes linearly from one value to another over a part of the run."""

    place: ClassVar[str] = "train.schedule"

    first: float = Field(ge=0.0, le=1e6, description="value up to `begin`")
    last: float = Field(ge=0.0, le=1e6, description="value from `end` on")
    begin: float = Field(0.0, ge=0.0, le=1.0, description="share of the run where it starts")
    end: float = Field(1.0, ge=0.0, le=1.0, description="share of the run where it is over")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.begin > self.end:
            raise ValueError(
                f"train.schedule: begin = {self.begin}: must be at most end = {self.end}"
            )
        return self

    def at(self, share: float) -> float:
        """The value when ``share`` of the run is done, 0 to 1."""
        if share >= self.end:
            return self.last
        if share <= self.begin:
            return self.first
        return self.first + (self.last - self.first) * (share - self.begin) / (
            self.end - self.begin
        )


class ScheduleConfig(Model):
    """Ramps over the run. What has none keeps the value that the scenario or the algorithm gives.

    The worlds stay as they are: the learner weighs their reward components.
    """

    place: ClassVar[str] = "train.schedule"

    dense_weight: Ramp | None = Field(
        None, description="factor of the shaping reward, beside the scenario's shaping_weight"
    )
    team_credit: Ramp | None = Field(
        None, description="share of the reward for rescues that goes to the whole team, 0 to 1"
    )
    potential_weight: Ramp | None = Field(
        None, description="factor of the potential's reward, where train.potential names a script"
    )
    gamma: Ramp | None = Field(None, description="discount of a control step, 0 to 1")
    entropy_weight: Ramp | None = Field(
        None, description="weight of the policy's entropy; td: the temperature"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("team_credit", "gamma"):
            ramp = getattr(self, name)
            if ramp is not None and max(ramp.first, ramp.last) > 1.0:
                raise ValueError(
                    f"train.schedule.{name}: first = {ramp.first} and last = {ramp.last} must be "
                    "in 0..1"
                )
        return self

    @property
    def weighs_rewards(self) -> bool:
        """Whether the learner weighs reward components itself."""
        ramps = (self.dense_weight, self.team_credit, self.potential_weight)
        return any(ramp is not None for ramp in ramps)
