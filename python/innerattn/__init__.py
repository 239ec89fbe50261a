"""Inner attention for teams of different robots: rescue worlds, learners and their evaluation.

Importing this package loads nothing heavy; take what you need from `innerattn.envs`,
`innerattn.learn`, `innerattn.train` and `innerattn.evaluate`. It makes the environment
``innerattn/Rescue-v0`` known to Gymnasium, without importing Gymnasium.
"""

from innerattn.registration import register_with_gymnasium

__version__: str

register_with_gymnasium()


def __getattr__(name: str) -> str:
    """The version, looked up when it is asked for: that takes longer than all else here."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("innerattn")
