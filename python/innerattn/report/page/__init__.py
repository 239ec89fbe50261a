"""One file with worlds, a team and all to play with them: no server and no network."""
