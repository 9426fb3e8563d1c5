"""Tables made by hand, those of the core's tests."""

from program.plots.conftest import bars, family, panels, plane, responses  # noqa: F401 - fixtures
