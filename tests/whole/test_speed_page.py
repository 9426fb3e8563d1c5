"""The page on speed: its blocks are what scripts print."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
import speed_page  # noqa: E402

TEXT = speed_page.PAGE.read_text(encoding="utf-8")
BLOCKS = dict(speed_page.BLOCK.findall(TEXT))


def test_every_block_has_a_command_and_every_command_a_block():
    assert BLOCKS.keys() == speed_page.COMMANDS.keys()


@pytest.mark.parametrize("name", BLOCKS)
def test_a_block_says_what_was_run_and_when(name):
    command = re.escape(f"`{speed_page.COMMANDS[name]}`")
    assert re.match(rf"\n{command}, \d{{4}}-\d\d-\d\d, .*, one thread, wavesweep \S+ \(\w+\):\n", BLOCKS[name])
    assert re.search(r"\d\.\d", BLOCKS[name].partition(":\n")[2])
