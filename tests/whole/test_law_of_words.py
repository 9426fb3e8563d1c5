"""Every printed sentence holds: random specs whose answers are known in closed form, and all that commands say of them.

`python tests/words --seeds 200` holds more of them, and runs more commands.
"""

import pytest
from words.devices import hold_device
from words.encoders import hold_encoder
from words.explanations import hold_entries, meanings
from words.hands import hold_hands
from words.law import OTHERS, hold_spec

FEW = (2, 14)  # numbers that are refuted, with holes, and losses at random


@pytest.mark.slow
@pytest.mark.asks("for_all", "contact", "require", "check", "reports", "margins", "simulation", "poles", "sensitivity")
@pytest.mark.parametrize("seed", range(20))
def test_what_is_said_of_a_spec_is_so(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_spec(seed, () if seed in FEW else OTHERS)


@pytest.mark.slow
@pytest.mark.asks("for_all", "passive", "designs")
@pytest.mark.parametrize("seed", [*range(6), 94])  # 4 and 94 have ports, of which one has a margin above 0
def test_what_is_said_of_a_device_is_so(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_device(seed)


@pytest.mark.slow
@pytest.mark.asks("check", "simulation")
@pytest.mark.parametrize("seed", [2, 5])
def test_what_is_said_of_an_encoder_is_so(seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_encoder(seed)


@pytest.mark.slow
@pytest.mark.asks("passive")
@pytest.mark.parametrize(("seed", "box"), [(0, True), (1, False), (2, True), (4, False), (5, False)])
def test_what_is_said_of_hands_is_so(seed, box, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hold_hands(seed, box)


def test_each_number_of_an_explanation_is_one_that_the_law_knows():
    for word in meanings():
        hold_entries(word)
