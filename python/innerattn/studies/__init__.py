"""Studies as files: which runs there are to do, and who does them."""
