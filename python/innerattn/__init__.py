"""Inner attention for teams of unlike robots: rescue worlds, learners and their evaluation.

Importing this package loads nothing heavy; take what you need from `innerattn.envs`,
`innerattn.learn`, `innerattn.train` and `innerattn.evaluate`.
"""

from importlib.metadata import version

__version__ = version("innerattn")
