"""The report on the paper's claims, tables and figures."""
