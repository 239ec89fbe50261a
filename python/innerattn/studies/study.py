"""A study as a file: which runs it compares, and the rules by which; it trains nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import ConfigDict, Field, ValidationError, field_validator, model_validator

from innerattn.config.files import toml_table_in
from innerattn.config.model import Model, config_error
from innerattn.config.near import did_you_mean
from innerattn.config.run import RunConfig, digest_of
from innerattn.envs.batch import FAULT_KINDS
from innerattn.errors import ConfigError
from innerattn.studies.seeds import listed_seeds
from innerattn.studies.shown import (
    CONTRASTS,
    DATED_RULES,
    HANDOFFS,
    OVER_ALL,
    Curves,
    Report,
    Shown,
    StudyTable,
)
from innerattn.studies.space import Length, Search, Value

_WORD = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"
_MOST_CONTRASTS = 200

Name = Annotated[str, Field(pattern=rf"^{_WORD}$")]
Direction = Literal["two-sided", "greater", "less"]


class Grid(Model):
    """What the runs of a study are made of: each combination is a run.

    Sections of a run's configuration may follow, with a list of values for each of their keys.
    """

    model_config = ConfigDict(extra="allow")
    place: ClassVar[str] = "grid"

    scenarios: tuple[str, ...] = Field(
        ("mixed",), min_length=1, description="built-in scenarios, or TOML files with one"
    )
    methods: tuple[str, ...] = Field(
        ("ppo-inner",), min_length=1, description="values of train.method"
    )
    budgets: tuple[str, ...] = Field(("fast",), min_length=1, description="built-in recipes")
    seeds: str | tuple[int, ...] = Field(
        (0, 1, 2), description="seeds of training: a list, or a range with both ends as text"
    )
    variants: tuple[str, ...] | None = Field(
        None, description="names of variants that it is combined with, unless with all"
    )

    @field_validator("seeds")
    @classmethod
    def _listed(cls, given: str | tuple[int, ...]) -> tuple[int, ...]:
        return listed_seeds(given, "grid.seeds")

    @model_validator(mode="after")
    def _check(self) -> Self:
        listed: dict[str, tuple[Any, ...]] = {
            "scenarios": self.scenarios,
            "methods": self.methods,
            "budgets": self.budgets,
            "seeds": self.numbers,
            "variants": self.variants or (),
            **self.keys,
        }
        for key, values in listed.items():
            if (twice := _first_twice(values)) is not None:
                raise ValueError(f"grid.{key}: {twice!r} stands twice")
        return self

    @property
    def numbers(self) -> tuple[int, ...]:
        """The seeds."""
        assert not isinstance(self.seeds, str)  # it was listed
        return self.seeds

    @property
    def keys(self) -> dict[str, tuple[Value, ...]]:
        """Values by dotted key of a run, of the keys that the grid varies."""
        found = {}
        for key, values in _flat(self.model_extra or {}, "grid"):
            if not isinstance(values, list) or not values:
                raise ValueError(f"grid.{key} = {values!r}: must be a list of values")
            found[key] = tuple(values)
        return found


class Variant(Model):
    """A named change of runs; sections of a run's configuration follow its name."""

    model_config = ConfigDict(extra="allow")
    place: ClassVar[str] = "variants"

    name: Name = Field(description="a word of its own")

    @property
    def changes(self) -> dict[str, Any]:
        """Values by dotted key of a run."""
        return dict(_flat(self.model_extra or {}, f"variants, {self.name}"))

    @classmethod
    def of(cls, name: str, changes: Mapping[str, Value]) -> Self:
        """A variant that makes some changes, by dotted key of a run."""
        sections: dict[str, Any] = {}
        for key, value in changes.items():
            *above, last = key.split(".")
            section = sections
            for word in above:
                section = section.setdefault(word, {})
            section[last] = value
        return cls.model_validate({"name": name, **sections})


class StudyContrast(Model):
    """A difference a - b over the same seeds, and the rules by which it is judged."""

    place: ClassVar[str] = "contrasts"

    name: str = Field(min_length=1, max_length=100, description="what is asked, in a few words")
    a: dict[str, Any] = Field(
        min_length=1, description="which runs: variant, scenario, method, budget or a key, by value"
    )
    b: dict[str, Any] = Field(min_length=1, description="which runs they are compared with")
    measure: str = Field(
        "score",
        description="score, score_as_seen, rescues_per_episode, train_seconds, "
        "train_cpu_seconds or a registered measure of a run",
    )
    measure_b: str | None = Field(
        None, description="measure of b, if it is another one than that of a"
    )
    length: Length | Literal["both"] = Field(
        "standard",
        description="length of the episodes: standard, long, or both, each with its own family",
    )
    margin: float = Field(gt=0.0, description="differences that are smaller count as none")
    direction: Direction = Field(
        "two-sided", description="hypothesis: a is another, a greater or a smaller value than b"
    )
    family: str = Field("all", description="contrasts whose p-values are adjusted together (Holm)")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.measure_b == self.measure:
            raise ValueError(f"contrasts.measure_b = {self.measure_b!r}: must be another measure")
        return self

    @property
    def lengths(self) -> tuple[Length, ...]:
        """The lengths of episodes at which it is judged."""
        return ("standard", "long") if self.length == "both" else (self.length,)

    @property
    def sides(self) -> tuple[dict[str, Value], dict[str, Value]]:
        """What a and b name, by coordinate of the grid."""
        return coordinates(self.a), coordinates(self.b)


SCORES = StudyTable(title="Scores")
"""The table of a study that lists none."""
RETAINED = "retained"
"""The measure of a run under faults: the share of its rescues that it retains. With a kind of fault
behind it, as in "retained_blackout", it is that of this kind alone."""
UNSEEN = "unseen_teams"
"""The measure of a run in teams that it has never met: its mean score."""


ACTOR = "actor"
"""How the measures of a run's attention in the actor begin."""


def has_own_episodes(measure: str) -> bool:
    """Whether a measure is of worlds of its own, so that it has one length of episodes."""
    return measure.startswith((RETAINED, UNSEEN, f"{ACTOR}_"))


class Faults(Model):
    """Faults that every finished run meets, each robot in turn."""

    place: ClassVar[str] = "faults"

    kinds: tuple[str, ...] = Field(FAULT_KINDS, min_length=1, description="kinds of faults")
    episodes: int = Field(100, ge=2, le=100_000, description="worlds in which each fault is tried")

    @field_validator("kinds")
    @classmethod
    def _known(cls, kinds: tuple[str, ...]) -> tuple[str, ...]:
        for kind in kinds:
            if kind not in FAULT_KINDS:
                near = did_you_mean(kind, FAULT_KINDS, repr)
                raise ValueError(
                    f"faults.kinds: {kind!r}: must be of {', '.join(FAULT_KINDS)}{near}"
                )
        if (twice := _first_twice(kinds)) is not None:
            raise ValueError(f"faults.kinds: {twice!r} stands twice")
        return kinds

    needs: ClassVar[str] = "any run"

    @staticmethod
    def takes(_: RunConfig) -> bool:
        """Whether a run meets them: every one does."""
        return True

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures of a run that they add."""
        return (RETAINED, *(f"{RETAINED}_{kind}" for kind in self.kinds))

    @property
    def table(self) -> StudyTable:
        """What is shown of them in a study that lists no tables."""
        title = "Share of the rescues that is retained under faults"
        return StudyTable(title=title, measures=self.measures, seeds=False)


class UnseenTeams(Model):
    """Teams that no run has met, in which each finished run of a policy for any team acts."""

    place: ClassVar[str] = "unseen_teams"
    needs: ClassVar[str] = "a method for any team: team-..."

    episodes: int = Field(500, ge=2, le=100_000, description="episodes in each of the 24 teams")

    @staticmethod
    def takes(run: RunConfig) -> bool:
        """Whether a run meets them: one of a policy for any team."""
        return run.algorithm.for_any_team

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures of a run that they add: a mean, the least, and means of groups."""
        parts = ("worst", "mixtures", "sizes", "bodies", "changes")
        return (UNSEEN, *(f"{UNSEEN}_{part}" for part in parts))

    @property
    def table(self) -> StudyTable:
        """What is shown of them in a study that lists no tables."""
        return StudyTable(title="Scores in unseen teams", measures=self.measures, seeds=False)


class ActorAttention(Model):
    """Episodes in which the attention in a run's actors is looked at, and attended robots fail."""

    place: ClassVar[str] = "actor_attention"
    needs: ClassVar[str] = (
        "network.encoder = 'entities' with network.pooling = 'attention', all teammates in the "
        "observation, no memory and no messages"
    )

    measures: ClassVar[tuple[str, ...]] = (
        f"{ACTOR}_handoffs",
        f"{ACTOR}_lead_before",
        f"{ACTOR}_lead_before_bystander",
        f"{ACTOR}_lead_after",
        f"{ACTOR}_lead_after_bystander",
        f"{ACTOR}_{RETAINED}_most_attended",
        f"{ACTOR}_{RETAINED}_least_attended",
        f"{ACTOR}_{RETAINED}_nearest",
        f"{ACTOR}_{RETAINED}_helper",
        f"{ACTOR}_{RETAINED}_other",
        f"{ACTOR}_attends_nearest",
        f"{ACTOR}_attends_helper",
    )
    """The measures of a run that they add; see docs/studies.md."""

    episodes: int = Field(400, ge=2, le=10_000, description="episodes, of twice the usual length")

    @staticmethod
    def takes(run: RunConfig) -> bool:
        """Whether a run's actors attend to teammates."""
        network = run.network
        attends = (network.encoder, network.pooling) == ("entities", "attention")
        plain = not network.memory_width and not network.message_width
        in_order = run.scenario.observed_teammates is None
        return attends and plain and in_order and not run.algorithm.for_any_team

    @property
    def table(self) -> StudyTable:
        """What is shown of them in a study that lists no tables."""
        return StudyTable(title="Attention in the actor", measures=self.measures, seeds=False)


Afterwards = Faults | UnseenTeams | ActorAttention
"""What finished runs are measured in beside their own evaluation."""


class Study(Model):
    """A study: runs, and what is asked of them."""

    place: ClassVar[str] = "study"

    question: str = Field("", description="what the study asks, in a sentence; opens its report")
    grid: tuple[Grid, ...] = Field(
        default_factory=lambda: (Grid(),),
        min_length=1,
        max_length=20,
        description="what its runs are made of: one grid, or several",
    )
    variants: tuple[Variant, ...] = Field(
        (), description="named changes; each is combined with the whole grid"
    )
    contrasts: tuple[StudyContrast, ...] = Field(
        (), max_length=_MOST_CONTRASTS, description="what is compared"
    )
    tables: tuple[StudyTable, ...] = Field(
        (), max_length=20, description="what is shown as tables; none: rescues and scores of all"
    )
    curves: tuple[Curves, ...] = Field(
        (), max_length=20, description="what is shown as learning curves"
    )
    faults: Faults | None = Field(None, description="faults that finished runs meet")
    unseen_teams: UnseenTeams | None = Field(
        None, description="teams that finished runs of policies for any team meet"
    )
    actor_attention: ActorAttention | None = Field(
        None, description="episodes in which attention in the actors of finished runs is looked at"
    )
    search: Search | None = Field(None, description="which values of a run are to be found")
    report: Report | None = Field(
        None, description="what the report shows, and which pages take parts of it"
    )

    @field_validator("grid", mode="before")
    @classmethod
    def _one_or_several(cls, given: Any) -> Any:
        return (given,) if isinstance(given, Mapping) else given

    @model_validator(mode="after")
    def _check(self) -> Self:
        for what, names in (
            ("variants", [one.name for one in self.variants]),
            ("contrasts", [one.name for one in self.contrasts]),
            (
                "tables and curves",
                [
                    *(CONTRASTS, OVER_ALL, DATED_RULES),
                    *([HANDOFFS] if self.actor_attention is not None else []),
                    *(s.title for s in self.shown),
                ],
            ),
        ):
            if (twice := _first_twice(names)) is not None:
                raise ValueError(f"{what}: the name {twice!r} stands twice")
        if self.report is not None and self.report.sections is not None:
            self._check_sections(self.report.sections)
        known = [one.name for one in self.variants]
        for name in (name for grid in self.grid for name in grid.variants or ()):
            if name not in known:
                near = did_you_mean(name, known, repr)
                raise ValueError(f"grid.variants: {name!r}: must be the name of a variant{near}")
        if self.search is not None:
            self._check_search(self.search)
        return self

    def _check_sections(self, sections: tuple[str, ...]) -> None:
        """Refuse what no report of it can show."""
        titles = [one.title for one in (*self.listed_tables, *self.curves)]
        handoffs = [HANDOFFS] if self.actor_attention is not None else []
        known = (CONTRASTS, *titles, *handoffs, OVER_ALL, DATED_RULES)
        for one in sections:
            if one not in known:
                near = did_you_mean(one, known, repr)
                raise ValueError(
                    f"report.sections: {one!r}: must be of {', '.join(map(repr, known))}{near}"
                )
        if (twice := _first_twice(sections)) is not None:
            raise ValueError(f"report.sections: {twice!r} stands twice")

    def _check_search(self, search: Search) -> None:
        """Refuse what a search does not stand beside."""
        for key in (
            "variants",
            "contrasts",
            "tables",
            "curves",
            "faults",
            "unseen_teams",
            "actor_attention",
        ):
            if getattr(self, key):
                raise ValueError(f"search: must stand without {key}")
        lists: dict[str, tuple[Value, ...]] = {
            "methods": self.grid[0].methods,
            "budgets": self.grid[0].budgets,
        }
        lists |= self.grid[0].keys
        several = [key for key, values in lists.items() if len(values) > 1]
        if len(self.grid) > 1 or several:
            which = f"grid.{several[0]} has several values" if several else "there are several"
            raise ValueError(f"search: must stand beside one grid of one recipe: {which}")
        both = [key for key in search.space if key in self.grid[0].keys]
        if both:
            raise ValueError(f"search.{both[0]}: is set by the grid, too")
        if len(self.grid[0].numbers) < 2:
            raise ValueError("grid.seeds: must be two seeds or more for a search")
        shared = set(search.confirm_seeds) & set(self.grid[0].numbers)
        if shared:
            raise ValueError(f"search.confirm: {min(shared)}: must be no seed of the grid")

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures that its own parts add to those of every run."""
        return tuple(measure for part in self.afterwards for measure in part.measures)

    @property
    def listed_tables(self) -> tuple[StudyTable, ...]:
        """Its tables, or those of a study that lists none."""
        if self.tables or self.search is not None:
            return self.tables
        return (SCORES, *(part.table for part in self.afterwards))

    @property
    def afterwards(self) -> list[Afterwards]:
        """What finished runs are measured in beside their own evaluation."""
        parts = self.faults, self.unseen_teams, self.actor_attention
        return [one for one in parts if one is not None]

    @property
    def shown(self) -> tuple[Shown, ...]:
        """Its tables and curves."""
        return (*self.tables, *self.curves)

    def values(self) -> dict[str, Any]:
        """What its file says, as JSON values; one grid is a table, and what it lacks is absent.

        Which pages take parts of the report is no rule, and left out.
        """
        values = self.model_dump(mode="json", exclude_none=True, exclude={"report": {"pages"}})
        for key in ("tables", "curves", "report"):  # added later: absent, digests are as before
            if not values.get(key, True):
                del values[key]
        if len(self.grid) == 1:
            (values["grid"],) = values["grid"]
        return values

    def digest(self) -> str:
        """SHA-256, in hexadecimal, of its values; comments and order in its file do not count."""
        return digest_of(self.values())


def study_in(data: bytes, path: str | Path) -> Study:
    """The study in the bytes of the TOML file at ``path``.

    Raises:
        ConfigError: they are not TOML, or hold no valid study; the message names the key.
    """
    table = toml_table_in(data, path)
    try:
        return Study.model_validate(table)
    except ValidationError as error:
        refused = str(config_error(error, source=str(path), model=Study))
        if isinstance(table.get("grid"), Mapping):  # as the file has it
            refused = refused.replace("grid[0]", "grid")
        raise ConfigError(refused) from error


def _first_twice(values: Iterable[Any]) -> Any | None:
    """The first value that stands there a second time."""
    seen = set[str]()
    for one in values:
        if (text := repr(one)) in seen:
            return one
        seen.add(text)
    return None


def coordinates(side: Mapping[str, Any], where: str = "contrasts") -> dict[str, Value]:
    """Values by coordinate of the grid, whose keys of a run may be sections."""
    words = {key: value for key, value in side.items() if not isinstance(value, Mapping)}
    keys = {key: value for key, value in side.items() if isinstance(value, Mapping)}
    return words | dict(_flat(keys, where))


def _flat(sections: Mapping[str, Any], place: str) -> Iterator[tuple[str, Any]]:
    """Values by dotted key of sections, which may have sections themselves."""
    for section, values in sections.items():
        if not isinstance(values, Mapping):
            raise ConfigError(
                f"{place}: {section}: unknown key; a run's keys are written SECTION.KEY"
            )
        for key, value in values.items():
            if isinstance(value, Mapping):
                for last, inner in value.items():
                    yield f"{section}.{key}.{last}", inner
            else:
                yield f"{section}.{key}", value
