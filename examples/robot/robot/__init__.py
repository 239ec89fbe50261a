"""A robot loop: one process for each robot of an exported team, and a world in place of hardware.

`python -m robot run EXPORT` drives a team; `python -m robot table EXPORT` measures what slow and
lossy links cost it.
"""
