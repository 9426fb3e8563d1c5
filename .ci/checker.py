"""`python .ci/checker.py FILE.pyz`: the checker as one file, which `python3 -I -S` runs where nothing is installed."""

import shutil
import sys
import tempfile
import zipapp
from pathlib import Path

CHECKER = Path(__file__).resolve().parents[1] / "wavesweep" / "checker"

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        inside = Path(folder) / "wavesweep"
        shutil.copytree(CHECKER, inside / "checker", ignore=shutil.ignore_patterns("__pycache__"))
        (inside / "__init__.py").touch()  # in place of the package's own
        archive = Path(sys.argv[1])
        archive.parent.mkdir(parents=True, exist_ok=True)
        zipapp.create_archive(folder, archive, "/usr/bin/env python3", "wavesweep.checker.__main__:run", compressed=True)
