"""The page that a study is reported as."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from innerattn.policies import best_script
from innerattn.report.folder import left_out_list
from innerattn.report.study.places import PlaceNames, named_values, set_there, varied_in
from innerattn.report.study.search import (
    SearchFound,
    search_page,
    search_rules,
    search_sentences,
)
from innerattn.report.table import Table, columns, markdown, plain_table
from innerattn.report.tables.text import plus_minus
from innerattn.stats.text import (
    NONE,
    format_estimate,
    format_number,
    format_p,
    format_seeds,
    format_signed,
)
from innerattn.studies.actor_attention import LeadCurves
from innerattn.studies.aggregates import THRESHOLDS, Aggregate
from innerattn.studies.curves import EPISODES, LearningCurve
from innerattn.studies.folder import Rules, StudyFolder
from innerattn.studies.ledger import State
from innerattn.studies.plan import TIMES, TRAIN_CPU_SECONDS, TRAIN_SECONDS
from innerattn.studies.results import RULES, Compared, Mean, Results, Values
from innerattn.studies.shown import CONTRASTS, DATED_RULES, HANDOFFS, OVER_ALL, StudyTable
from innerattn.studies.space import Length
from innerattn.studies.study import ACTOR, RETAINED, UNSEEN, Afterwards, has_own_episodes


@dataclass(frozen=True)
class Found:
    """What a report shows.

    Attributes:
        study: in its folder, with its rules over time.
        states: of its runs by key.
        results: its finished runs, and why others are left out.
        tables: means by title, each with what it shows.
        compared: its contrasts.
        aggregates: of its algorithms by name, for each length of episodes.
        curves: learning curves by title; without those of archived runs.
        leads: of attention in the actor around handoffs, by the place in the grid.
        search: its search, if it has one.
        note: what is said of runs that are too short to mean anything.
    """

    study: StudyFolder
    states: Mapping[str, State]
    results: Results
    tables: Mapping[str, tuple[StudyTable, Sequence[Mean]]] = field(default_factory=dict)
    compared: Sequence[Compared] = ()
    aggregates: Mapping[Length, Mapping[str, Aggregate]] = field(default_factory=dict)
    curves: Mapping[str, Sequence[LearningCurve]] = field(default_factory=dict)
    leads: Mapping[str, LeadCurves] = field(default_factory=dict)
    search: SearchFound | None = None
    note: str | None = None


def study_page(found: Found, figures: Mapping[str, str]) -> str:
    """The page as Markdown.

    Args:
        found: what it shows.
        figures: files of figures, "scores", "search", `HANDOFFS` and by title of curves.
    """
    study, results, compared = found.study, found.results, found.compared
    keys = {one.run.key for one in results.finished}
    planned = any(best_script(one.summary["scripted"]) == "planner" for one in results.finished)
    parts = [f"# {study.study.question or study.path.name}\n"]
    if found.note:
        parts.insert(0, f"> **{found.note[:1].upper()}{found.note[1:]}.**\n")
    parts += [f"{one}\n" for one in answers(found)]
    parts += [f"{len(keys)} of {len(found.states)} runs are done.\n"]
    for part in study.study.afterwards:
        if without := _not_measured(results, part):
            what = part.place.replace("_", " ")
            parts += [
                f"{without} of these have not met the {what}; `innerattn study run` lets them.\n"
            ]
    parts += left_out_list(left_out(results))
    if found.search is not None:
        parts += search_page(found.search, figures.get("search"))
    if "scores" in figures:
        parts += [f"![Scores of all runs]({figures['scores']})\n", _DOTS]
    of_search = [] if found.search is None else [search_rules(found.search.search)]
    sections = {
        CONTRASTS: [contrasts_tables(compared)] if compared else [],
        **{title: _means_section(*own, planned) for title, own in found.tables.items()},
        **{
            title: [f"![{title}]({figures[title]})\n", _CURVES]
            for title in found.curves
            if title in figures
        },
        HANDOFFS: [f"![{_LEADS_SHOW}]({figures[HANDOFFS]})\n", _LEADS]
        if HANDOFFS in figures
        else [],
        OVER_ALL: (
            [markdown(aggregates_table(found.aggregates)), _AGGREGATES]
            if any(found.aggregates.values())
            else []
        ),
        DATED_RULES: [*of_search, RULES, "", *map(_dated, study.rules), ""],
    }
    report = study.study.report
    shown = sections if report is None or report.sections is None else report.sections
    for title in shown:
        if text := sections.get(title):
            parts += [f"## {title}\n", *text]
    return "\n".join(parts)


def _means_section(shown: StudyTable, rows: Sequence[Mean], planned: bool) -> list[str]:
    """A table of means with its captions; nothing without rows.

    Args:
        shown: what it shows.
        rows: its means.
        planned: whether a score of 1 means `planner` in some of the worlds.
    """
    if not rows:
        return []
    of_faults = any(one.startswith(RETAINED) for one in shown.measures)
    of_teams = any(one.startswith(UNSEEN) for one in shown.measures)
    of_actors = any(one.startswith(f"{ACTOR}_") for one in shown.measures)
    captions = [
        *[_MEANS if of_actors else _SCORE, *[_PLANNED] * planned, *[_RETAINED] * of_faults],
        *[_UNSEEN] * of_teams,
        *[_ACTOR] * of_actors,
    ]
    return [markdown(means_table(rows, shown.seeds)), *captions]


def _not_measured(results: Results, part: Afterwards) -> int:
    """How many finished runs lack measures that a part of the study adds."""
    able = [one for one in results.finished if part.takes(one.run.config)]
    return len({one.run.key for one in able if not {*part.measures} <= {*one.measured}})


def answers(found: Found) -> list[str]:
    """What the study says, in Markdown: of its search, then of its contrasts."""
    first = [] if found.search is None else search_sentences(found.search)
    return first + sentences(found.compared)


def left_out(results: Results) -> list[str]:
    """What a report says of runs that are not in it.

    It is one line where a scenario lacks the same seeds everywhere, else one for each place.
    """
    all_places = [run.place for run in results.planned]
    keys = list(dict.fromkeys(["scenario", "method", *varied_in(all_places)]))
    names = PlaceNames(all_places)
    places: dict[str, set[str]] = {}
    seeds: dict[tuple[str, str, str], list[int]] = {}
    for run in results.planned:
        places.setdefault(str(run.place["scenario"]), set()).add(names.name(run.place, keys))
    for run, reason in results.left_out:
        place = names.name(run.place, keys)
        seeds.setdefault((str(run.place["scenario"]), place, reason), []).append(run.seed)
    alike: dict[tuple[str, str, tuple[int, ...]], list[str]] = {}
    for (scenario, place, reason), those in seeds.items():
        alike.setdefault((scenario, reason, tuple(those)), []).append(place)
    lines = []
    for (scenario, reason, same), those_places in alike.items():
        which = f"seed{'s' * (len(same) > 1)} {format_seeds(same)}: {reason}"
        if len(those_places) == len(places[scenario]) > 1:
            lines.append(f"{scenario}, {which} ({len(those_places) * len(same)} runs)")
        else:
            lines += [f"{place}, {which}" for place in those_places]
    return lines


_SCORE = (
    "A score of 0 plays like `random`, a score of 1 like `hungarian`, in the same worlds. ± is "
    "half the 95 % interval over seeds (Student's t); in brackets are the values of the seeds.\n"
)
_PLANNED = (
    "Where times, energy, loads, sums or the order of tasks ask for plans, a score of 1 plays like "
    "`planner`.\n"
)
_RETAINED = (
    "Retained is the share of the rescues that a team keeps: a mean over its robots, each of which "
    "has the fault in turn, over severities, and over faults from the start and from the middle of "
    "the episode. Episodes are twice as long as those of the training.\n"
)
_UNSEEN = (
    "Unseen teams are 24 that no run has met: eight draws of the family, eight sizes from 2 to 24 "
    "robots, four with bodies outside of the family's ranges, and four in which a robot leaves, "
    "joins or becomes slow at half time (changes). The score is that in each team, a mean over "
    "them or the worst. Episodes have 50 steps.\n"
)
_MEANS = (
    "± is half the 95 % interval over seeds (Student's t); in brackets are the values of the "
    "seeds.\n"
)
_ACTOR = (
    "A lead is a robot's weight on the next partner minus that on the last one, a mean over three "
    "steps up to the first rescue (before) or after it. Retained is the share of the rescues after "
    "one of the robots with the shared ability fails: the one that the other robots attend to "
    "most, or least, the one nearest to them, the helper, which would help first, or the other "
    "one. Attends nearest and attends helper are the shares of episodes in which the most attended "
    "one is the nearest, and the helper. Episodes are twice as long as those of the training.\n"
)
_LEADS_SHOW = "Weight of actors on the next partner less that on the last one, around handoffs"
_LEADS = (
    "Curves are means over seeds with 95 % intervals (Student's t), each of a run's handoffs. The "
    "action of step 0 completes the first rescue. The bystander is the other robot of the same "
    "ability, in the same steps.\n"
)
_DOTS = "A dot is a run; a bar is the mean over seeds with its 95 % interval.\n"
_CURVES = (
    "Curves are training episodes with sampled actions: means over seeds with 95 % intervals "
    "(Student's t), of two seeds the range. Minutes are means over seeds. Dotted lines are scripts "
    "in episodes as long as those of training: in the worlds of the evaluation, or, where its "
    f"episodes have another length, in {EPISODES} episodes in worlds as those of the training.\n"
)
_AGGREGATES = (
    "IQM is the interquartile mean of the score over runs and scenarios, with a 95 % interval of a "
    "bootstrap within scenarios. The other columns are the share of runs that score more: a "
    "performance profile (Agarwal et al. 2021). `scores.json` has the scores as rliable takes "
    "them, `marl_eval.json` as marl-eval does. P(a > b) in the contrasts is the probability of "
    "improvement of the same source. With few seeds bootstraps are too sure.\n"
)


def aggregates_table(aggregates: Mapping[Length, Mapping[str, Aggregate]]) -> Table:
    """Interquartile mean and performance profile of every algorithm."""
    rows = [
        [
            name,
            length,
            str(sum(map(len, one.scores.values()))),
            NONE if one.iqm is None else format_estimate(one.iqm),
            *(f"{100.0 * share:.0f} %" for share in one.above),
        ]
        for length, found in aggregates.items()
        for name, one in found.items()
    ]
    heads = ["runs", "IQM [95 %]", *(f"> {threshold:g}" for threshold in THRESHOLDS)]
    return plain_table(columns(["algorithm", "episodes"], heads), rows)


def algorithm_names(found: Sequence[Aggregate]) -> dict[str, Aggregate]:
    """Algorithms by a name of their own: what differs between their places in the grid."""
    varied = varied_in([one.algorithm for one in found]) or ["method"]
    return {" ".join(named_values(one.algorithm, varied)): one for one in found}


def means_table(found: Sequence[Mean], seeds: bool = False) -> Table:
    """Measures of every place in the grid.

    Args:
        found: at least one.
        seeds: whether the value of each seed is shown; then means are bold, for Markdown.
    """
    places = [one.place for one in found]
    varied = varied_in(places) or ["method"]
    partly = [key for key in varied if any(key not in place for place in places)]
    always = [key for key in varied if key not in partly]
    rows = []
    for one in found:
        cells = [value_cell(x) if seeds else plus_minus(x.mean) for x in one.values.values()]
        named = named_values(one.place, always) + ([set_there(one.place, partly)] if partly else [])
        rows.append([*named, format_seeds(one.seeds), *cells])
    heads = []
    for measure, length in found[0].values:
        if has_own_episodes(measure):
            heads.append(_own_head(measure))
            continue
        if measure in TIMES:
            heads.append(_IN_WORDS[measure])
            continue
        steps = {one.episode_steps[length] for one in found}
        which = f"{steps.pop()} steps" if len(steps) == 1 else f"{length} episodes"
        heads.append(f"{_IN_WORDS.get(measure, measure.replace('_', ' '))}, {which}")
    named = [*always, "keys"] if partly else always
    return plain_table(columns(named, ["seeds", *heads]), rows)


def _own_head(measure: str) -> str:
    """A measure whose episodes have a length of their own, in words."""
    if measure.startswith(f"{ACTOR}_"):
        return measure.removeprefix(f"{ACTOR}_").replace("_", " ")
    whole = next(one for one in (RETAINED, UNSEEN) if measure.startswith(one))
    part = measure.removeprefix(whole).replace("_", " ").strip()
    return ", ".join(filter(None, (whole.replace("_", " "), part)))


def _in_words(measure: str) -> str:
    return _own_head(measure) if has_own_episodes(measure) else measure.replace("_", " ")


_IN_WORDS = {
    "rescues_per_episode": "rescues",
    TRAIN_SECONDS: "training [s]",
    TRAIN_CPU_SECONDS: "training [CPU s]",
}


def value_cell(values: Values) -> str:
    """The mean over seeds with half its interval, and the value of each seed."""
    mean = values.mean
    if mean is None:
        return NONE
    each = ", ".join(NONE if one is None else format_number(one) for one in values.each.values())
    half = f" ± {format_number((mean.high - mean.low) / 2)}" if mean.bounded else ""
    return f"**{format_number(mean.mean)}**{half} ({each})"


def contrasts_tables(compared: Sequence[Compared]) -> str:
    """Every contrast with its numbers, a table for each measure, length and margin."""
    groups: dict[tuple[str, Length, float], list[tuple[Compared, str]]] = {}
    for one, (sides, where) in zip(compared, _sides(compared), strict=True):
        measure = one.contrast.measure if one.contrast.measure_b is None else ""
        key = measure, one.length, one.contrast.margin
        groups.setdefault(key, []).append((one, f"{sides} ({where})" if where else sides))
    parts = []
    for (measure, length, margin), own in groups.items():
        rows = [
            [
                one.contrast.name,
                sides,
                format_seeds(one.seeds) or NONE,
                NONE if one.found is None else format_estimate(one.found.difference),
                NONE if one.improvement is None else format_estimate(one.improvement),
                format_p(one.holm_p),
                one.verdict,
            ]
            for one, sides in own
        ]
        heads = ["seeds", "difference [95 %]", "P(a > b) [95 %]", "Holm's p", "verdict"]
        words = measure.replace("_", " ") or "difference of two measures"
        episodes = (
            ""
            if has_own_episodes(measure or own[0][0].contrast.measure)
            else f", {length} episodes"
        )
        parts += [
            f"**{words[:1].upper()}{words[1:]}{episodes}**; within {margin:g} is alike.\n",
            markdown(plain_table(columns(["contrast", "a - b"], heads), rows)),
        ]
    return "\n".join(parts)


def sentences(compared: Sequence[Compared]) -> list[str]:
    """What each contrast says, in Markdown; places that say the same are named together.

    Of a contrast at both lengths of episodes it is what the standard one says.
    """
    groups: dict[str, list[tuple[Compared, str, str]]] = {}
    for one, (sides, where) in zip(compared, _sides(compared), strict=True):
        if one.length == one.contrast.lengths[0]:
            groups.setdefault(one.contrast.name, []).append((one, sides, where))
    return [
        _sentence(*own[0]) if len(own) == 1 else _together(name, own)
        for name, own in groups.items()
    ]


def _together(name: str, own: Sequence[tuple[Compared, str, str]]) -> str:
    """One contrast at several places."""
    verdicts: dict[str, list[str]] = {}
    for one, _, where in own:
        verdicts.setdefault(one.verdict, []).append(where)
    sides = list(dict.fromkeys(sides for _, sides, _ in own))
    which = f", {sides[0]}" if len(sides) == 1 else ""
    told = "; ".join(f"{verdict} in {', '.join(places)}" for verdict, places in verdicts.items())
    return f"**{name}**{which}: {told}."


def _sentence(one: Compared, sides: str, where: str) -> str:
    head = f"**{one.contrast.name}**, {sides}{f' ({where})' if where else ''}: {one.verdict}"
    if one.mean is None:
        return f"{head}, no seed has both runs."
    measure = one.contrast.measure.replace("_", " ") if one.contrast.measure_b is None else "a"
    if one.found is None:
        return f"{head}; {measure} differs by {format_signed(one.mean)} over {_seeds(one)}."
    difference = format_estimate(one.found.difference)
    return f"{head}; {measure} differs by {difference} over {_seeds(one)}."


def _seeds(one: Compared) -> str:
    return f"{len(one.seeds)} seed{'' if len(one.seeds) == 1 else 's'}"


def _sides(compared: Sequence[Compared]) -> list[tuple[str, str]]:
    """What differs between both sides of each contrast, and what they share that others do not."""
    sides = [place for one in compared for place in (one.a, one.b)]
    varied, names = varied_in(sides), PlaceNames(sides)
    texts = []
    for one in compared:
        free = [key for key in varied if one.a.get(key) != one.b.get(key)]
        a, b = (" ".join(str(side[key]) for key in free if key in side) for side in (one.a, one.b))
        if one.contrast.measure_b is not None:
            of_a, of_b = (_in_words(x) for x in (one.contrast.measure, one.contrast.measure_b))
            a, b = f"{a} {of_a}".strip(), f"{b} {of_b}".strip()
        shared = [key for key in varied if key not in free]
        texts.append((f"{a} - {b}", names.name(one.a, shared)))
    return texts


def _dated(one: Rules) -> str:
    when = "before the first run" if not one.finished else f"after {one.finished} runs were done"
    return f"- Rules {one.digest[:16]} of {one.date}, given {when}."
