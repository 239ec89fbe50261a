"""The report on what faults cost: its page and its tables."""
