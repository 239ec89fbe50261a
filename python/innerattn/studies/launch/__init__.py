"""Ways to start workers of a study; each starts the command `innerattn study work`."""
