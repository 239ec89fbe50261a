"""Studies: many runs trained side by side, then seen together as the paper's tables and figures.

It prints nothing.
"""
