"""Everything that a training run needs; a run is repeated from it alone.

Sections are in `sections` and, for each algorithm, beside its registration.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from innerattn.config.algorithm import AlgorithmConfig, Needs
from innerattn.config.family import Family
from innerattn.config.files import preset_names
from innerattn.config.model import (
    ADDED_LATER,
    Model,
    config_error,
    places_of_keys,
    values_for_digest,
)
from innerattn.config.near import did_you_mean
from innerattn.config.ppo import PPOConfig
from innerattn.config.registry import algorithms, methods
from innerattn.config.scenario import Scenario
from innerattn.config.sections import EvaluateConfig, ImitationConfig, NetworkConfig, TrainConfig
from innerattn.config.td import TDConfig
from innerattn.errors import ConfigError

BUDGETS = preset_names("budgets")
"""Names of the built-in budgets: how long to train, and with which numbers."""


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
    """A whole run. What `train.method` and continuous actions need follows where it is not given.

    An algorithm of an extension has a section of its own where it is given or in use.

    Raises:
        pydantic.ValidationError: (a `ValueError`) unknown key, wrong type, value out of range, or
            values that contradict each other; the message names the key and what is allowed.
    """

    model_config = ConfigDict(extra="allow")  # sections of registered algorithms

    scenario: Scenario = Field(default_factory=Scenario, description="the world")
    network: NetworkConfig = Field(default_factory=NetworkConfig, description="the networks")
    td: TDConfig = Field(default_factory=TDConfig, description="numbers of the TD methods")
    ppo: PPOConfig = Field(default_factory=PPOConfig, description="numbers of the PPO methods")
    imitation: ImitationConfig = Field(
        default_factory=ImitationConfig, description="numbers of a warm start"
    )
    train: TrainConfig = Field(default_factory=TrainConfig, description="the run")
    evaluate: EvaluateConfig = Field(default_factory=EvaluateConfig, description="measuring")
    family: Annotated[Family | None, ADDED_LATER] = Field(
        None,
        description="teams that one policy is trained for, with a method team-...; None: the "
        "scenario's own team",
    )

    @property
    def algorithm(self) -> AlgorithmConfig:
        """The section of the algorithm that `train.method` names."""
        section: AlgorithmConfig = getattr(self, methods()[self.train.method].algorithm.name)
        return section

    @property
    def potential_discount(self) -> float:
        """Discount of a control step in the potential: `train.potential_discount`, or gamma."""
        given = self.train.potential_discount
        return self.algorithm.gamma if given is None else given

    @property
    def training_scenario(self) -> Scenario:
        """The worlds of training: `scenario`, or with another engine or length of episodes."""
        chosen = {"episode_steps": self.train.episode_steps, "engine": self.train.engine}
        return self.scenario.replace(**{k: v for k, v in chosen.items() if v is not None})

    def shared_by_workers(self) -> dict[str, int]:
        """What `train.workers` must divide, by key."""
        wholes = {"train.num_envs": self.train.num_envs}
        algorithm = self.algorithm
        wholes |= {f"{algorithm.place}.{key}": n for key, n in algorithm.batches.items()}
        if self.train.warm_start != "none":
            wholes["imitation.batch_size"] = self.imitation.batch_size
        return wholes

    def in_use(self) -> dict[str, dict[str, Any]]:
        """The values that the run depends on, as JSON values by section and key.

        Sections of other algorithms, and that of a warm start where there is none, are left out.
        """
        return self.model_dump(mode="json", exclude=self._unused())

    def digest(self) -> str:
        """SHA-256, in hexadecimal, of the values `in_use` as JSON with sorted keys.

        It does not depend on how a file writes the values, nor on whether the file gives a default.
        Keys that were added after runs had been published count only where they are not at their
        default; see `innerattn.config.model.ADDED_LATER`.
        """
        return digest_of(self.digest_values())

    def digest_values(self) -> dict[str, Any]:
        """The values that `digest` is of, by section and key."""
        values = values_for_digest(self)
        for section in self._unused() & values.keys():
            del values[section]
        return values

    def _unused(self) -> set[str]:
        """Sections that the run does not depend on."""
        unused = algorithms().keys() - {self.algorithm.place}
        unused |= {Family.place} if self.family is None else set()
        return unused if self.train.warm_start != "none" else unused | {"imitation"}

    @model_validator(mode="before")
    @classmethod
    def _follow_method(cls, data: Any) -> Any:
        """Fill in what the method needs, and check the sections of registered algorithms."""
        if not isinstance(data, Mapping):
            return data
        method = methods().get(str(_given(data.get("train")).get("method")))
        for section, one in algorithms().items():
            given = data.get(section)
            if method is not None and one != method.algorithm and isinstance(given, Mapping):
                kept = {key: given[key] for key in given if key not in one.config.removed}
                data = {**data, section: kept}
        if method is not None:
            needs = {method.algorithm.name: {}, **method.needs}
            if _given(data.get("scenario")).get("actions") == "continuous":
                for section, values in (method.algorithm.continuous or {}).items():
                    needs[section] = {**needs.get(section, {}), **values}
            for section, values in needs.items():
                if isinstance(data.get(section, {}), Mapping | BaseModel):  # else its check says so
                    data = {**data, section: {**values, **_given(data.get(section))}}
        return {
            key: value if key in cls.model_fields else _registered_section(key, value, cls)
            for key, value in data.items()
        }

    @model_validator(mode="after")
    def _check(self) -> Self:
        name = self.train.method
        self._check_needs(methods()[name].needs, f"train.method = {name!r}")
        if self.scenario.actions == "continuous":
            self._check_continuous()
        refuse_late_faults(self.scenario, self.evaluate)
        self._check_swap()
        self._check_masks()
        self._check_potential()
        self._check_workers()
        self._check_any_team()
        self._check_memory()
        self._check_messages()
        self._check_observed_teammates()
        gamma, world = self.algorithm.gamma, self.scenario
        if world.shaping == "potential" and self.train.schedule.gamma is not None:
            raise ValueError(
                "train.schedule.gamma: potential shaping needs one discount throughout; "
                "scenario.shaping_discount has one"
            )
        if world.shaping == "potential" and world.shaping_discount != gamma:
            raise ValueError(
                f"scenario.shaping_discount = {world.shaping_discount!r}: potential shaping leaves "
                f"the best policy as it is only with the learner's {self.algorithm.place}.gamma = "
                f"{gamma!r}"
            )
        return self

    def _check_needs(self, needs: Needs, what: str) -> None:
        for section, values in needs.items():
            for key, wanted in values.items():
                value = getattr(getattr(self, section), key)
                if value != wanted:
                    raise ValueError(f"{section}.{key} = {value!r}: {what} needs {wanted!r}")

    def _check_continuous(self) -> None:
        """Refuse what learns discrete actions only."""
        what, known = "scenario.actions = 'continuous'", methods()
        needs = known[self.train.method].algorithm.continuous
        if needs is None:
            able = (name for name, one in known.items() if one.algorithm.continuous is not None)
            raise ValueError(
                f"{what}: train.method = {self.train.method!r} learns 'discrete' actions only; "
                f"methods for continuous ones are {', '.join(able)}"
            )
        self._check_needs(needs, what)

    def _check_swap(self) -> None:
        """Refuse to swap what is the same, or does not fit."""
        names = self.network.swapped_robots
        if names is None:
            return
        kinds = {robot.name: robot.kind for robot in self.scenario.robots}
        key = f"network.swapped_robots = {list(names)}"
        if len(set(names) & kinds.keys()) < 2 or kinds[names[0]] != kinds[names[1]]:
            raise ValueError(f"{key}: must be two robots of a kind, of {', '.join(kinds)}")
        if self.network.parameter_sharing != "none":
            raise ValueError(f"{key}: network.parameter_sharing must be 'none'")

    def _check_workers(self) -> None:
        """Refuse workers whose shares would differ."""
        count, method = self.train.workers, self.train.method
        if count == "auto" or count == 1:
            return
        if not methods()[method].algorithm.averages_over_workers:
            raise ValueError(
                f"train.workers = {count}: must be 1 for train.method = {method!r}, whose learner "
                "does not average over workers"
            )
        for key, whole in self.shared_by_workers().items():
            if whole % count:
                raise ValueError(f"train.workers = {count}: must divide {key} = {whole}")

    def _check_any_team(self) -> None:
        """Refuse a family, and imitation alone, for methods that learn for one team."""
        train = self.train
        if self.algorithm.for_any_team:
            if train.env_steps == 0 and train.warm_start == "none":
                raise ValueError("train.env_steps = 0: must be at least 1 without a warm start")
            return
        able = ", ".join(n for n, one in methods().items() if one.algorithm.config.for_any_team)
        if self.family is not None:
            raise ValueError(
                f"family: train.method = {train.method!r} learns for one team; methods for a "
                f"family are {able}"
            )
        if train.env_steps == 0:
            raise ValueError("train.env_steps = 0: must be at least 1")

    def _check_memory(self) -> None:
        """Refuse a memory for what cannot train one."""
        network, train = self.network, self.train
        if not network.memory_width:
            return
        key = f"network.memory_width = {network.memory_width}"
        if not self.algorithm.remembers:
            able = ", ".join(n for n, one in methods().items() if one.algorithm.config.remembers)
            raise ValueError(
                f"{key}: train.method = {train.method!r} has no memory; must be 0, or a method of "
                f"{able}"
            )
        if train.warm_start != "none":
            raise ValueError(
                f"{key}: train.warm_start = {train.warm_start!r} imitates single steps; must be "
                "'none'"
            )
        try:
            self.algorithm.check_memory()
        except ValueError as error:
            raise ValueError(f"{error}, because {key}") from None

    def _check_messages(self) -> None:
        """Refuse messages for what cannot train them."""
        train, width = self.train, self.network.message_width
        if not width:
            return
        if not self.algorithm.speaks:
            able = ", ".join(n for n, one in methods().items() if one.algorithm.config.speaks)
            raise ValueError(
                f"network.message_width = {width}: train.method = {train.method!r} has no "
                f"messages; must be 0, or a method of {able}"
            )
        if train.warm_start != "none":
            raise ValueError(
                f"network.message_width = {width}: train.warm_start = {train.warm_start!r} "
                "imitates robots that say nothing; must be 'none'"
            )

    def _check_observed_teammates(self) -> None:
        """Refuse what has to know which teammate is which where rows have the nearest ones."""
        if (most := self.scenario.observed_teammates) is None:
            return
        network, key = self.network, f"scenario.observed_teammates = {most}"
        if network.message_width:
            raise ValueError(
                f"{key}: must be left out where robots have messages (network.message_width = "
                f"{network.message_width}), which come from teammates in team order"
            )
        if network.attention == "oracle" and network.symmetry != "none":
            raise ValueError(
                f"network.symmetry = {network.symmetry!r}: must be 'none' where the attention is "
                f"'oracle' and {key}; robots compare their places, which frames turn"
            )

    def _check_masks(self) -> None:
        """Refuse masks of actions for what has none."""
        if not self.network.mask_actions:
            return
        key, train = "network.mask_actions = true", self.train
        if self.algorithm.for_any_team:
            raise ValueError(f"{key}: train.method = {train.method!r} has no masks; must be false")
        if self.scenario.actions != "discrete":
            raise ValueError(f"{key}: scenario.actions must be 'discrete'")
        if train.warm_start != "none":
            raise ValueError(
                f"{key}: train.warm_start = {train.warm_start!r} imitates robots that cannot act, "
                "too; must be 'none'"
            )

    def _check_potential(self) -> None:
        """Refuse keys of a potential that do not go together."""
        train = self.train
        if train.potential == "none":
            if train.potential_discount is not None:
                key = f"train.potential_discount = {train.potential_discount!r}"
            elif train.schedule.potential_weight is not None:
                key = "train.schedule.potential_weight"
            else:
                return
            raise ValueError(f"{key}: train.potential = 'none' needs None")
        if train.potential_discount is not None:
            return
        if train.schedule.gamma is not None:
            raise ValueError(
                "train.potential_discount = None: must be given where train.schedule.gamma changes "
                "the learner's discount, because a potential has one discount throughout"
            )
        if self.algorithm.gamma >= 1.0:
            raise ValueError(
                f"train.potential = {train.potential!r}: a potential needs a discount below 1; "
                f"{self.algorithm.place}.gamma = {self.algorithm.gamma!r}, so "
                "train.potential_discount must be given"
            )


def _given(section: object) -> Mapping[str, Any]:
    """What a section (a table or a model) sets."""
    if isinstance(section, BaseModel):
        return section.model_dump(exclude_unset=True)
    return section if isinstance(section, Mapping) else {}


def _registered_section(name: str, given: object, run: type[RunConfig]) -> AlgorithmConfig:
    """The section of an algorithm that is no field of `RunConfig`.

    Raises:
        ValueError: There is no such section, or it is not valid.
    """
    algorithm = algorithms().get(name)
    if algorithm is None:
        known = {section: section for section in (*run.model_fields, *algorithms())}
        if not isinstance(given, Mapping):  # no section, but perhaps a key of one
            known |= places_of_keys(run)
        raise ValueError(f"{name}: unknown key{did_you_mean(name, known, known.__getitem__)}")
    try:
        return algorithm.config.model_validate(given)
    except ValidationError as error:
        raise ValueError(str(config_error(error, name, model=algorithm.config))) from error


def digest_of(values: Mapping[str, Any]) -> str:
    """SHA-256, in hexadecimal, of JSON values with sorted keys."""
    text = json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
