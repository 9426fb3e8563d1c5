"""Checks proof files against a spec, with Python's standard library alone (`python -m wavesweep.checker SPEC FILE`).

In the order of reading: `balls.py` numbers that are enclosed; `reader/` what a spec means, from its documents; `frame.py` the
matrix of a frame; `form.py` the inequality that is the proof, and `contact.py` that of walls that let go; `file.py` the file, and
which cells and edges there have to be.
"""

VERSION = "1.0"
"""Of this folder, wherever it is copied."""
