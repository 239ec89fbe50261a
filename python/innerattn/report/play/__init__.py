"""A page in which a person plays with a team that acts live, on this machine alone."""
