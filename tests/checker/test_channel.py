"""The norm of the wave channel: what is proved of it holds by its closed form, and nothing below."""

import numpy as np
import pytest
from scipy.signal import butter, freqz
from support.proofs import checked

pytest.importorskip("wavesweep.proofs", reason="its forms are those that are proved")
from wavesweep.checker import file
from wavesweep.checker.channel import RECEIVED, SENT
from wavesweep.proofs.gains import claims_of_energy, of_waves

RATIO = 5
DRAWN = """
rates.tick_hz = 1000
[block]
device = { type = "mass", mass = 0.1, damping = 1.5 }
end = { type = "wave", b = 25 }
filter = { type = "butterworth", order = 1, cutoff_hz = 30 }
avatar = { type = "avatar", b = 25, every = 5 }
[wire]
"end.v" = "device.v"
"end.in" = "avatar.out + 20*avatar.x - 20*device.x"
"filter.u" = "end.out"
"avatar.in" = "filter.y"
"avatar.f" = "500*avatar.x_spring"
"device.f" = "f - end.force"
[ports.hand]
force = "f"
displacement = "device.x"
"""


def spec(kind="pmw", order=1, more="") -> str:
    return f'controller.kind = "{kind}"\nrates.ratio = {RATIO}\nfilters.lp1 = {{ order = {order}, cutoff_hz = 30 }}\n{more}'


def aliased(order: int) -> float:
    """The largest sum of the squares of a filter at the frequencies that a sampler takes for one, of the root."""
    if not order:
        return RATIO**0.5
    theta = np.linspace(0, np.pi, 400)[:, None] + 2 * np.pi * np.arange(RATIO)
    _, response = freqz(*butter(order, 30, fs=1000), worN=theta.ravel() / RATIO)
    return float(np.sqrt((np.abs(response.reshape(theta.shape)) ** 2).sum(1)).max())


CASES = {
    "order 1": (spec(), aliased(1)),
    "order 2": (spec(order=2), aliased(2)),
    "no filter": (spec(order=0), aliased(0)),
    "drawn": (DRAWN, aliased(1)),
    "two returned waves": (spec("pmw-lm", more="filters.hp.order = 0\nfilters.lp2.order = 0"), None),
    "mean": (spec("pmw-mean"), 1.0),
}


def claim(text: str, norm: float) -> list[dict]:
    found = claims_of_energy(file.spec_of(text.encode()), {}, "", (0.0, 0.0), of_waves(norm))
    return [line for lines in found for line in lines]


@pytest.mark.parametrize("case", CASES)
def test_a_norm_is_proved_next_to_its_closed_form_and_nothing_below(tmp_path, case):
    text, norm = CASES[case]
    # of unfiltered waves that return together: what both ways have, and one into two
    norm = norm or (1 + aliased(1) ** 2) ** 0.5
    head, *cells = claim(text, norm)
    code, words = checked(tmp_path, text, [head, *cells])
    assert (code, "the norm of the wave channel is below" in words) == (0, True), words
    assert "stable" not in words
    below = head | {"gain": head["gain"] | {"at_most": repr(norm * (1 - 1e-9))}}
    assert "the gain may be" in checked(tmp_path, text, [below, *cells])[1]
    with pytest.raises(file.Refused, match="not below its level"):
        claim(text, norm * (1 - 2e-6))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"from": "f_h"}, "'waves received' is not known"),
        ({"to": "x"}, "the input of a controller is f_h"),
        ({"at_most": "1"}, "the gain may be 1.0"),
    ],
)
def test_another_channel_is_refused(tmp_path, change, why):
    head, *cells = claim(spec(), aliased(1))
    assert (head["gain"]["from"], head["gain"]["to"]) == (SENT, RECEIVED)
    forged = head | {"gain": head["gain"] | change}
    assert why in checked(tmp_path, spec(), [forged, *cells])[1]


def test_a_loop_without_waves_has_no_channel(tmp_path):
    head, *cells = claim(spec(), aliased(1))
    other = spec("dc-slow")
    assert "the loop has no wave channel" in checked(tmp_path, other, [head, *cells])[1]
