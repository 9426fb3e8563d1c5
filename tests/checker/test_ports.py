"""The hand's port: what is proved passive is so by a scan of frequencies, and what says more is refused."""

import numpy as np
import pytest
from scipy.linalg import expm
from support.proofs import checked

pytest.importorskip("wavesweep.proofs", reason="its forms are those that are proved")
from wavesweep.checker import file
from wavesweep.checker.port import PLACE, PUSH
from wavesweep.proofs.gains import claims_of_energy

T, MASS, DAMPING, RATIO = 1e-3, 0.1, 3.0, 3
WALL = f"""
[controller]
kind = "dc-slow"
[device]
mass = {MASS}
damping = {DAMPING}
[rates]
ratio = {RATIO}
[environment]
integration = "explicit"
K_VE = 100
B_VE = 0.5
"""
SPRING = """
rates.tick_hz = 1000
numbers = { k = 10.0 }
[block]
body = { type = "mass", mass = 0.1, damping = 2, stiffness = "k" }
[wire]
"body.f" = "f"
[ports.hand]
force = "f"
displacement = "body.x"
"""


def claim(spec: str, numbers=None, name="", span=(0.0, 0.0)) -> list[dict]:
    found = claims_of_energy(file.spec_of(spec.encode()), numbers or {}, name, span, None)
    return [line for lines in found for line in lines]


def least_eigenvalue(K: float, B: float) -> float:
    """Of the Hermitian part of the map from held forces to ways in ticks, over frequencies but those next to 0."""
    motion = np.zeros((3, 3))
    motion[0, 1], motion[1, 1:] = 1, [-DAMPING / MASS, 1 / MASS]
    tick = expm(motion * T)
    state = np.zeros((2, 2 + RATIO))  # over x, v as a frame begins, and its forces
    state[:, :2] = np.eye(2)
    wall = K * state[0] + B * state[1]
    ways = []
    for number in range(RATIO):
        force = -wall + np.eye(2 + RATIO)[2 + number]
        later = tick[:2, :2] @ state + np.outer(tick[:2, 2], force)
        ways.append(later[0] - state[0])
        state = later
    C, D = np.split(np.array(ways), [2], axis=1)
    least = []
    for theta in np.linspace(0.05, np.pi, 400):
        G = D + C @ np.linalg.solve(np.exp(1j * theta) * np.eye(2) - state[:, :2], state[:, 2:])
        least.append(np.linalg.eigvalsh(G + G.conj().T)[0])
    return min(least)


@pytest.mark.slow
def test_a_port_is_proved_in_frames_of_more_ticks_than_a_loop_may_have_memory(tmp_path):
    spec = WALL.replace("ratio = 3", "ratio = 210").replace("K_VE = 100", "K_VE = 4").replace("damping = 3.0", "damping = 8")
    assert checked(tmp_path, spec, claim(spec))[0] == 0


@pytest.mark.slow
def test_a_port_is_proved_up_to_where_a_scan_of_frequencies_says_that_it_ends(tmp_path):
    low, high = 0.5, 100.0
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if least_eigenvalue(100, middle) > 0 else (low, middle)
    assert 0.6 < low < 99
    lines = claim(WALL, {}, "B_VE", (0.5, low))
    code, words = checked(tmp_path, WALL, lines)
    assert (code, words.count("the hand's port is passive")) == (0, 1)
    (begin, end) = map(float, lines[0]["sides"]["B_VE"])
    assert begin == 0.5
    assert low * (1 - 1e-3) < end <= low
    for beyond in (1.001, 1.01, 2):
        with pytest.raises(file.Refused, match="not passive"):
            claim(WALL, {"B_VE": repr(beyond * low)})
    wider = [lines[0] | {"sides": {"B_VE": ["0.5", repr(1.001 * low)]}}, *lines[1:]]
    assert "the hand's port may not be passive" in checked(tmp_path, WALL, wider)[1]


def test_from_no_spring_to_a_stiff_one(tmp_path):
    lines = claim(SPRING, {}, "k", (0.0, 1000.0))
    assert lines[0]["sides"] == {"k": ["0.0", "1000.0"]}
    assert checked(tmp_path, SPRING, lines)[0] == 0


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"numbers": {"k": "-10"}}, "may not be passive"),  # (1) holds, and the loop is not stable
        ({"drifts": [[PLACE, "@body x0"]]}, "not every equation keeps"),
        ({"drifts": []}, "the states are"),
        ({"claim": "gain"}, "a claim of a gain"),
        ({"claim": "modes", "outside": 0}, "mode"),
        ({"gain": {"from": "f", "to": "f", "at_most": "1"}}, "and no other, has a gain"),
    ],
)
def test_another_port_is_refused(tmp_path, change, why):
    head, cell = claim(SPRING)
    code, words = checked(tmp_path, SPRING, [head | change, cell])
    assert code in (1, 2)
    assert why in words


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("damping = 2", "damping = -2", "may not be passive"),  # modes outside
        ('"body.f" = "f"', '"body.f" = "-f"', "may not be passive"),  # a hand that is pushed as it pulls
        ('displacement = "body.x"', 'displacement = "-body.x"', "may not be passive"),
        ('force = "f"', 'force = ["f"]', "a hand of one force"),
    ],
)
def test_the_port_is_that_of_the_spec(tmp_path, old, new, why):
    head, cell = claim(SPRING)
    assert why in checked(tmp_path, SPRING.replace(old, new), [head, cell])[1]


def test_a_push_that_drifts_without_its_place_is_refused(tmp_path):
    head, cell = claim(SPRING)
    (names,) = head["drifts"]
    other = {"drifts": [sorted(names, key=lambda name: name != PUSH)], "states": sorted([*head["states"], PLACE])}
    size = len(other["states"])
    L = [[str(int(i == j)) for j in range(size)] for i in range(size)]
    assert "does not begin with" in checked(tmp_path, SPRING, [head | other, cell | {"L": L}])[1]


def test_a_form_without_its_sign_is_refused(tmp_path):
    head, cell = claim(SPRING)
    for form in ([["0"] * 2] * 2, [["1", "0"], ["0", "0"]]):
        assert "may not be passive" in checked(tmp_path, SPRING, [head, cell | {"L": form}])[1]
    assert "L and Q alone" in checked(tmp_path, SPRING, [head, cell | {"signs": "--"}])[1]
