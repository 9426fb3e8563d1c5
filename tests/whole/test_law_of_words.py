"""Every printed sentence holds: random specs whose answers are known in closed form, and all that commands say of them.

`python tests/words --seeds 200` holds more of them, and runs more commands.
"""

import pytest
from words.devices import hold_device
from words.explanations import hold_entries, meanings
from words.hands import hold_hands
from words.law import OTHERS, hold_spec

# Numbers that are refuted, with holes, and losses at random; the others are of the thorough lane.
FEW = (2, 14)
SEEDS = [*FEW, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(60) if seed not in FEW)]


@pytest.mark.slow
@pytest.mark.asks("for_all", "contact", "require", "check", "reports", "margins", "simulation", "poles", "sensitivity")
@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_said_of_a_spec_is_so(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_spec(seed, () if seed in FEW else OTHERS)


# Ports, of which one has a margin above 0; the others have masses that are not known, designs, and frames.
QUICK_DEVICES = (4, 94)
DEVICES = [*QUICK_DEVICES, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(20) if seed not in QUICK_DEVICES)]


@pytest.mark.slow
@pytest.mark.asks("for_all", "passive", "designs")
@pytest.mark.parametrize("seed", DEVICES)
def test_what_is_said_of_a_device_is_so(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_device(seed)


@pytest.mark.slow
@pytest.mark.asks("passive")
@pytest.mark.parametrize(
    ("seed", "box"), [(1, False), *(pytest.param(seed, seed < 4, marks=pytest.mark.thorough) for seed in (0, *range(2, 12)))]
)
def test_what_is_said_of_hands_is_so(seed, box, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_hands(seed, box)


def test_each_number_of_an_explanation_is_one_that_the_law_knows():
    for word in meanings():
        hold_entries(word)
