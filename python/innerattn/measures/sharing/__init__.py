"""How a team shares its work: evenly or not, rightly or not, and whether attention follows."""
