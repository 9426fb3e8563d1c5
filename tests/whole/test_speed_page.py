"""The pages with measured times: their blocks are what scripts print."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))
import in_place_of  # noqa: E402
import speed_page  # noqa: E402

BLOCKS = dict(found for page in speed_page.PAGES for found in speed_page.BLOCK.findall(page.read_text(encoding="utf-8")))


def test_every_block_has_a_command_and_every_command_a_block():
    assert BLOCKS.keys() == speed_page.COMMANDS.keys()


@pytest.mark.parametrize("name", BLOCKS)
def test_a_block_says_what_was_run_and_when(name):
    command = re.escape(f"`{speed_page.COMMANDS[name]}`")
    assert re.match(rf"\n{command}, \d{{4}}-\d\d-\d\d, .*, one thread, wavesweep \S+ \(\w+\):\n", BLOCKS[name])
    assert re.search(r"\d\.\d", BLOCKS[name].partition(":\n")[2])


@pytest.mark.slow
def test_second_moments_by_hand_grow_between_what_is_proved_and_what_is_refuted():
    found, proved, refuted, *_ = in_place_of.moments()
    assert proved < found <= refuted * (1 + 1e-9)
    assert refuted < 1.0001 * proved


@pytest.mark.slow
def test_a_grid_of_eigenvalues_misses_what_is_certified():
    missed, off, *_ = in_place_of.grid()
    assert missed > 0
    assert 0 < off <= in_place_of.STIFFNESSES[0]
