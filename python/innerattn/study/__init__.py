"""Studies: many runs that belong together, trained side by side; it prints nothing."""
