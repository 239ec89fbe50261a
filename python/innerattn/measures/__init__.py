"""Measures: pure functions of records. It plays nothing and reads no file."""

from innerattn.measures.measure import Measure, Value
from innerattn.measures.registry import MEASURES, measure_of, measures_of, needed_fields, register

__all__ = ["MEASURES", "Measure", "Value", "measure_of", "measures_of", "needed_fields", "register"]
