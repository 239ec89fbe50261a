"""Studies: many runs planned, trained side by side, and seen together as data.

It prints nothing.
"""
