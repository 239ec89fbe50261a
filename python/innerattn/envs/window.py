"""A window that shows one world while it is played; it needs matplotlib and a display."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Window:
    """A window of matplotlib, updated no faster than a number of frames per second."""

    def __init__(self, title: str, fps: float) -> None:
        """Open it. Where there is no display, one line on standard error says so.

        Args:
            title: of the window.
            fps: most frames per second [1/s].
        """
        import matplotlib
        from matplotlib import pyplot as plt
        from matplotlib.backend_bases import FigureManagerBase

        self._figure = plt.figure(title, figsize=(8, 6))
        manager = self._figure.canvas.manager
        if manager is None or type(manager).show is FigureManagerBase.show:
            plt.close(self._figure)
            print(
                "innerattn: render_mode = 'human': no window can be opened (no display, or "
                f"matplotlib's backend {matplotlib.get_backend()!r} has none); 'rgb_array' gives "
                "pictures",
                file=sys.stderr,
            )
            return
        self._frame_s = 1.0 / fps
        self._due = 0.0
        manager.show()

    def update(self, paint: Callable[[Figure], None]) -> None:
        """Show the world anew, and wait until the next frame is due.

        Once somebody has closed the window, nothing happens.

        Args:
            paint: draws on the empty figure.
        """
        from matplotlib import pyplot as plt

        if not plt.fignum_exists(self._figure.number):
            return
        self._figure.clear()
        paint(self._figure)
        canvas = self._figure.canvas
        canvas.draw_idle()
        now = time.monotonic()
        self._due = max(self._due, now) + self._frame_s
        # The loop lets the window draw itself and answer the mouse.
        canvas.start_event_loop(max(self._due - self._frame_s - now, 1e-3))

    def close(self) -> None:
        """Close it."""
        from matplotlib import pyplot as plt

        plt.close(self._figure)
