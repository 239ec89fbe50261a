"""How scenarios, worlds, records and runs show themselves in a notebook. It draws nothing."""

from __future__ import annotations

from importlib import import_module

DRAWN_BY = "innerattn.report.notebook"
"""The module that draws them; it is loaded when a notebook asks for the first picture."""


class Shown:
    """What a notebook shows as a picture or a replay instead of text."""

    def _repr_html_(self) -> str:
        """HTML for IPython and Jupyter."""
        return str(import_module(DRAWN_BY).html_of(self))
