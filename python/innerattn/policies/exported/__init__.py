"""Teams that `innerattn export` wrote, as a robot runs them: numpy alone, or onnxruntime.

It imports neither torch nor the worlds.
"""

from __future__ import annotations

from innerattn.policies.exported.decision import Decision
from innerattn.policies.exported.team import Exported

__all__ = ["Decision", "Exported"]
