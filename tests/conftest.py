"""Makes `tests/support` importable as `support`, what several test folders share, and marks tests by the fixtures they read."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

SLOW = {"judged", "quick"}  # fixtures that take seconds, whichever test asks for them first


def pytest_collection_modifyitems(items):
    """Tests that read such a fixture are slow."""
    for item in items:
        if SLOW.intersection(item.fixturenames):
            item.add_marker("slow")
