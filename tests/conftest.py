"""Makes `tests/support` importable as `support`, gives BLAS one thread, and marks tests by the fixtures that they read."""

import os
import sys
from pathlib import Path

from wavesweep.arithmetic import ONE_THREAD

sys.path.insert(0, str(Path(__file__).parent))
# As the command line does: threads of BLAS in every worker of the tests are in each other's way. Nothing has loaded numpy yet.
os.environ.update({name: os.environ.get(name, "1") for name in ONE_THREAD})

SLOW = {"judged", "quick"}  # fixtures that take seconds, whichever test asks for them first


def pytest_collection_modifyitems(items):
    """Tests that read such a fixture are slow."""
    for item in items:
        if SLOW.intersection(item.fixturenames):
            item.add_marker("slow")
