"""A search for better values: which are proposed, how long each stays, and what it found."""
