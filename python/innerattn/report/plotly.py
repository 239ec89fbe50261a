"""The plotting library of pages, plotly.js, as its Python package ships it."""

from __future__ import annotations

from importlib.resources import files

from innerattn.errors import MissingLibraryError


def plotly_script() -> str:
    """The library's script.

    Raises:
        MissingLibraryError: plotly is not installed.
    """
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        needed = "plots of a page need plotly: pip install 'innerattn[report]'"
        raise MissingLibraryError(needed) from error
    return str(get_plotlyjs())


def plot_script() -> str:
    """Our script that draws `innerattn.report.runs.plots.Plot` in the reader's colours."""
    return (files("innerattn.report.runs") / "web" / "plots.js").read_text("utf-8")
