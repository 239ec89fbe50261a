"""Independent PPO for innerattn: numbers and registration. This module does not import torch."""

from typing import ClassVar

from pydantic import Field

from innerattn.config import Algorithm, AlgorithmConfig, register_algorithm


class IPPOConfig(AlgorithmConfig):
    """Independent PPO: every robot learns by itself."""

    place: ClassVar[str] = "ippo"

    gae_lambda: float = Field(0.9, ge=0.0, le=1.0, description="horizon of advantages")
    learning_rate: float = Field(0.003, gt=0.0, le=1.0, description="step size of Adam")
    rollout_steps: int = Field(25, ge=1, description="control steps between updates [steps]")
    epochs: int = Field(5, ge=1, description="passes over a rollout")
    minibatch_size: int = Field(400, ge=1, description="rows of a rollout per update")
    clip: float = Field(0.2, gt=0.0, lt=1.0, description="largest change of a ratio that counts")
    entropy_weight: float = Field(0.01, ge=0.0, description="weight of the policy's entropy")

    @property
    def rows_per_update(self) -> int:
        """Rows of a minibatch."""
        return self.minibatch_size

    def rows_of_training(self, env_steps: int) -> int:
        """Rows of all passes over all rollouts."""
        return env_steps * self.epochs


register_algorithm(
    Algorithm(
        config=IPPOConfig,
        learner="ippo.learner:IPPO",
        methods={
            "ippo": {
                "network": {
                    "attention": "none",
                    "mask_unavailable": False,
                    "encoder": "flat",
                    "parameter_sharing": "none",
                }
            }
        },
    )
)
