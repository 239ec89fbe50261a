"""Training of one policy for a family of teams."""
