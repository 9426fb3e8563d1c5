"""Code of the documents."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def code(title):
    """The names that the Python of a section of CONTRIBUTING defines."""
    section = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]
    names = {}
    exec(re.search(r"```python\n(.*?)```", section, re.DOTALL).group(1), names)  # noqa: S102 - the document's own code
    return names
