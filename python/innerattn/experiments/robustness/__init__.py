"""What faults cost teams: with and without training for them, and by the size of the team."""
