"""A schedule of an instance to watch, as a page of its own. It plans nothing."""

from innerattn.report.schedule.page import schedule_page

__all__ = ["schedule_page"]
