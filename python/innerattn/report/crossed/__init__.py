"""The report on the crossed design: its page, its tables and its figures."""
