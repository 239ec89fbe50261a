"""The command line: reading options and printing results; nothing is computed here."""
