"""The report of a study: its answer, its rules, its numbers."""
