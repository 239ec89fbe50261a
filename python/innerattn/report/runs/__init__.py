"""One page about finished runs: what was trained, what it scored, and how it acts."""

from innerattn.report.runs.page import runs_page

__all__ = ["runs_page"]
