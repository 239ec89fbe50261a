"""What the stages of a training ask of that which is trained: collect, learn, and be saved."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from torch import Tensor

from innerattn.config import RunConfig
from innerattn.learn.interruptions import Interruptions
from innerattn.learn.resume import State
from innerattn.learn.ring import Ring
from innerattn.train.checkpoint_info import Stage
from innerattn.train.collect import Tally
from innerattn.train.metrics import Interval


class Training(ABC):
    """The parts of one training, and their state as a whole.

    Attributes:
        config: the run.
        interval: counts since the last line of metrics.
        env_steps_at_once: env-steps, of all workers, that one call of `collect` or `imitate` does.
        robot_names: of the team, for messages; empty where there is no one team.
        imitation_env_steps: length of the warm start; None: there is none, or it is over.
    """

    config: RunConfig
    interval: Interval
    env_steps_at_once: int
    robot_names: Sequence[str]
    imitation_env_steps: int | None

    @property
    @abstractmethod
    def updates(self) -> int:
        """Updates done so far."""

    @property
    @abstractmethod
    def can_resume(self) -> bool:
        """Whether the training can go on in another process."""

    @abstractmethod
    def begin(self, interruptions: Interruptions) -> None:
        """Do what comes before the first step, also after a stop."""

    @abstractmethod
    def imitate(self, share: float) -> Mapping[str, float]:
        """Collect while a script is imitated; ``share`` of the imitation is done. Metrics."""

    @abstractmethod
    def learn_imitating(self, share: float) -> Mapping[str, float]:
        """Do the updates that are due after `imitate`; metrics."""

    @abstractmethod
    def collect(self, share: float) -> Mapping[str, float]:
        """Collect with the policy; ``share`` of learning from rewards is done. Metrics."""

    @abstractmethod
    def learn(self, share: float) -> Mapping[str, float]:
        """Do the updates that are due after `collect`; metrics."""

    @abstractmethod
    def take_tally(self) -> Tally:
        """Counts since the last call, of all workers."""

    @abstractmethod
    def attention_entropy(self) -> dict[str, list[float]]:
        """Entropy of the critic's attention by robot and head [nats]; empty where it has none."""

    @abstractmethod
    def weights(self) -> dict[str, Tensor]:
        """Everything learnt, by name."""

    @abstractmethod
    def compile(self) -> None:
        """Compile the updates."""

    @abstractmethod
    def rings(self, stage: Stage) -> dict[str, Ring]:
        """The large memories that are needed from ``stage`` on, by name."""

    @abstractmethod
    def resume_state(self, stage: Stage) -> dict[str, Tensor]:
        """All else that is needed to go on in ``stage``, by name; see `Resumable`."""

    @abstractmethod
    def load(self, weights: State, state: State, stage: Stage) -> None:
        """Go on from a state, once the rings are filled.

        Raises:
            ValueError: it is none of an equal run in this stage.
        """
