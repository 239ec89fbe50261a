"""A study's file to begin with: every part with its meaning, as commented TOML."""

from __future__ import annotations

_TEXT = """\
# The study {name}.
#
#   innerattn study run {file}        trains, measures and compares its runs
#   innerattn study status {file}     says how far it is
#
# A line that begins with # and a key is an example: remove the # to use it. docs/studies.md
# explains every part. Rules are dated: the report says how many runs were done when they changed.

# What the study asks; the first line of its report.
question = "Does parameter sharing matter?"

# Each combination of these lists is a run.
[grid]
# built-in scenarios, or TOML files with one, from the folder of this file
scenarios = ["mixed"]
# values of train.method
methods = ["ppo-inner"]
# built-in recipes of training: quick is a smoke test and gives no result
budgets = ["fast"]
# seeds of training, both ends; or a list; three or more decide
seeds = "0..4"
# any key of a run, with a list of values
#ppo.learning_rate = [0.001, 0.002]

# Each variant is a name and the keys of a run that it changes; all are combined with the grid.
[[variants]]
name = "own"
network.parameter_sharing = "none"

[[variants]]
name = "kind"
network.parameter_sharing = "kind"

# A difference a - b over the same seeds, for each combination that both sides leave open.
[[contrasts]]
name = "sharing"
a = {{ variant = "kind" }}
b = {{ variant = "own" }}
# score, rescues_per_episode or a registered measure
measure = "score"
# measure of b, if it is another one
#measure_b = "score_as_seen"
# length of the measured episodes: standard, long or both
length = "standard"
# differences that are smaller count as none
margin = 0.03
# two-sided, greater or less
direction = "two-sided"
# contrasts whose p-values are adjusted together (Holm)
family = "all"

# A table of means over seeds, with the value of each seed; without one: rescues and scores.
#[[tables]]
#title = "Scores"
# which runs, by coordinates of the grid; none: all
#of = {{ variant = "kind" }}
# measures; ", long" behind one means episodes of the second length
#measures = ["rescues_per_episode", "score", "score, long"]
#seeds = true

# A figure of rescues in training; it needs matplotlib.
[[curves]]
title = "Learning curves"

# Which sections the report shows below its answer, in this order; none: all.
#[report]
#sections = ["Contrasts", "Scores", "Learning curves", "Over all scenarios", "Rules"]

# Sections of the report go to a page between <!-- answer: begin --> and <!-- answer: end -->:
# innerattn study report {file} --publish FOLDER-OF-PAGE
#[[report.pages]]
#page = "results.md"
#part = "answer"
#sections = ["Contrasts"]
# the finished runs as one file
#archive = "runs.parquet"

# Faults that each finished run meets. They add the measures retained and retained_KIND: the share
# of the rescues that a team keeps.
#[faults]
# kinds of faults; none: all
#kinds = ["motor_gain", "blackout", "unavailable"]
# worlds in which each fault is tried
#episodes = 100

# Teams that no run has met, for methods team-... alone. They add the measures unseen_teams,
# unseen_teams_worst and means of four groups: scores in 24 teams.
#[unseen_teams]
#episodes = 500

# Handoffs and failures of runs whose actors attend to teammates, as network.encoder = "entities"
# lets them (docs/studies.md). They add measures that begin with actor_.
#[actor_attention]
#episodes = 400

# A search for better values (Optuna) instead of variants and contrasts: trials race over the seeds
# of the grid. It needs innerattn[search].
#[search]
# how many sets of values are tried
#trials = 30
#measure = "score"
#length = "standard"
# which values of the measure are better: maximize or minimize
#direction = "maximize"
# further seeds, with which the best trial is compared with the grid as it is
#confirm = "100..102"
#margin = 0.03
# any key of a run, with its ends or a list of values
#ppo.learning_rate = {{ low = 0.0005, high = 0.01, log = true }}
"""


def new_study(name: str, file: str) -> str:
    """The text of a study's file; `innerattn.studies.study.study_in` reads it.

    Args:
        name: what the head of the file calls the study.
        file: the name of the file, for the commands in its head.
    """
    return _TEXT.format(name=name, file=file)
