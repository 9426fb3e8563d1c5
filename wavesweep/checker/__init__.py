"""Checks proof files against a spec, with nothing but Python's standard library (`python -m wavesweep.checker SPEC FILE`)."""
