"""Networks for teams of any size, whose robots and abilities have no names.

They look at tables of robots and victims (`tables`), work out who can help whom and when
(`relations`), and choose actions from one row for each pair of a robot and a victim that it can
help (`actor`). No weight belongs to a robot, an ability or a place in a list.
"""

from innerattn.nn.teams.actor import TeamActor
from innerattn.nn.teams.critic import TeamCritic
from innerattn.nn.teams.pooling import POOLINGS
from innerattn.nn.teams.relations import Relations, relate
from innerattn.nn.teams.tables import TeamTables, joined_tables

__all__ = [
    "POOLINGS",
    "Relations",
    "TeamActor",
    "TeamCritic",
    "TeamTables",
    "joined_tables",
    "relate",
]
