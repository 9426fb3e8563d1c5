"""The page "Check it yourself" does what it shows."""

import re
import subprocess
import sys
from pathlib import Path

from support.proofs import checked_file

from wavesweep.checker import VERSION
from wavesweep.checker.__main__ import LIMITS

PAGE = Path(__file__).parents[2] / "docs/check-it-yourself.md"


def test_the_proof_of_the_page_is_proved_in_its_words(tmp_path):
    text = PAGE.read_text(encoding="utf-8")
    files = dict(re.findall(r"```(?:toml|python)\n# (\S+)\n([\s\S]*?)```", text))
    for name, lines in files.items():
        (tmp_path / name).write_text(lines, encoding="utf-8")
    subprocess.run([sys.executable, "turn.py"], cwd=tmp_path, check=True)
    assert all(f"{option} {limit:g}`" in text for option, limit in LIMITS.items())
    shown = re.search(r"\n    \$ python -m wavesweep\.checker turn\.toml turn\.proof\n((?:    .*\n)+)", text)
    code, words = checked_file(tmp_path / "turn.toml", tmp_path / "turn.proof")
    assert code == 0
    first = f"wavesweep checker {VERSION}"
    assert [first, *words.splitlines()] == [line.strip() for line in shown[1].splitlines()]
