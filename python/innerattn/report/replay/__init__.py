"""Episodes to watch: a page of its own, or a moving picture. It plays nothing."""

from innerattn.report.replay.moments import read_moments
from innerattn.report.replay.page import replay_page

__all__ = ["read_moments", "replay_page"]
