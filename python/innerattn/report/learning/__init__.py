"""The report on what methods learn: its page, its tables and its figure."""
