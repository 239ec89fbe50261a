"""Measures: pure functions of records. It plays nothing and reads no file."""
