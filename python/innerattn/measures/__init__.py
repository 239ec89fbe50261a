"""Measures: pure functions of records. It plays nothing and reads no file."""

from innerattn.measures.measure import Measure, Value
from innerattn.measures.registry import MEASURES, measures_of, needed_fields, register

__all__ = ["MEASURES", "Measure", "Value", "measures_of", "needed_fields", "register"]
