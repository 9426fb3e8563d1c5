"""Every printed sentence holds: random specs whose answers are known in closed form, and all that commands say of them.

`python tests/words --seeds 200` holds more of them, and runs more commands.
"""

import pytest
from words.law import OTHERS, hold_spec

# Losses; margins of a hole; frames in any order with numbers; a curve; numbers that are refuted.
FEW = (1, 10, 19)
SEEDS = [*FEW, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(60) if seed not in FEW)]


@pytest.mark.slow
@pytest.mark.asks(
    "for_all", "contact", "require", "check", "reports", "margins", "simulation", "poles", "sensitivity", "inspect"
)
@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_said_of_a_spec_is_so(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_spec(seed, OTHERS if seed not in FEW or seed == FEW[0] else ())
