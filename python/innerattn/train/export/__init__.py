"""Writes a trained team for robots: ONNX files, weights for numpy, and a contract.

`innerattn.policies.Exported` reads what is written here.
"""

from innerattn.train.export.write import export_run, needed_libraries

__all__ = ["export_run", "needed_libraries"]
