"""Write what the benchmarks print into the pages, so that no number there is of another version than it says.

    OPENBLAS_NUM_THREADS=1 python benchmarks/speed_page.py [NAME ...]

Each block of a page, from `<!-- measured: NAME -->` to `<!-- end -->`, has the lines that a command prints, and where and
when it was run. Names: those of blocks, all by default.
"""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).parent
PAGES = [HERE.parent / "docs" / name for name in ("speed.md", "in-place-of.md")]
BLOCK = re.compile(r"^<!-- measured: (\w+) -->\n(.*?)^<!-- end -->$", re.MULTILINE | re.DOTALL)
COMMANDS = {
    "questions": "python benchmarks/what_takes_how_long.py",
    "rivals": "python benchmarks/rival_times.py",
    "grid": "python benchmarks/grid_ratio.py",
    "panels": "python benchmarks/panel_speed.py --least --rounds 3",
    "growth": "python benchmarks/cliffs.py --least",
    "pairs": "python benchmarks/in_place_of.py",
}


def measured(name: str) -> str:
    """The text of a block: the command, where and when it was run, and what it printed."""
    program, *arguments = COMMANDS[name].split()
    at = Path(sys.executable).parent / program
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([at, *arguments], cwd=HERE.parent, env=environment, capture_output=True, text=True, check=True)
    said = done.stdout.strip()
    lines = said if said.startswith("|") else f"```text\n{said}\n```"
    return f"`{COMMANDS[name]}`, {_where()}:\n\n{lines}\n"


def _where() -> str:
    """The day, the processor and the version."""
    from bench.report import _commit, _processor
    from wavesweep import __version__

    return f"{time.strftime('%Y-%m-%d')}, {_processor()}, one thread, wavesweep {__version__} ({_commit()[:8]})"


def main() -> None:
    """Write the blocks that are named."""
    if unknown := [name for name in sys.argv[1:] if name not in COMMANDS]:
        sys.exit(f"no page has a block {', '.join(unknown)}; there are {', '.join(COMMANDS)}")
    for name in sys.argv[1:] or COMMANDS:
        block = f"<!-- measured: {name} -->\n\n{measured(name)}\n<!-- end -->"
        for page in PAGES:
            text = page.read_text(encoding="utf-8")
            text = BLOCK.sub(lambda found, new=block, own=name: new if found[1] == own else found[0], text)
            page.write_text(text, encoding="utf-8")  # each as soon as it is there


if __name__ == "__main__":
    main()
