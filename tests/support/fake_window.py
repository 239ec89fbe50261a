"""A backend of matplotlib whose windows only note what happens to them."""

from typing import ClassVar

from matplotlib.backend_bases import FigureManagerBase
from matplotlib.backends.backend_agg import FigureCanvasAgg


class FigureManager(FigureManagerBase):
    """A window that nobody sees."""

    def show(self) -> None:
        """Do nothing."""


class FigureCanvas(FigureCanvasAgg):
    """Draws at once, and waits for nothing."""

    manager_class = FigureManager
    waited: ClassVar[list[float]] = []
    """Seconds that the event loop was asked to run, for each frame."""

    def start_event_loop(self, timeout: float = 0) -> None:
        """Note the time and draw."""
        self.waited.append(timeout)
        self.draw()
