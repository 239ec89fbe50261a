"""What faults of robots cost a team, and what its attention makes of them."""
