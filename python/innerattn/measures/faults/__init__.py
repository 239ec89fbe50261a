"""What faults of robots cost, from records alone."""
