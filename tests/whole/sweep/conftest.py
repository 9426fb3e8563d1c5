"""Specs and tables of sweeps, those of the core's tests."""

from program.sweep.conftest import _small_chunks, long, long_table, mixed, other, same_tables  # noqa: F401 - fixtures
