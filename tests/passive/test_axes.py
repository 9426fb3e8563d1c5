"""The port of a hand of several axes, against the maps of marches in Cartesian coordinates, single axes and turned frames."""

import numpy as np
import pytest
from meaning.reading import machine_of, with_numbers
from meaning.responses import at_angle
from support.axes import before_a_wall

import wavesweep

pytestmark = pytest.mark.asks("axes")  # for its walls
ANGLES = np.concatenate([np.geomspace(1e-3, 0.5, 20), np.linspace(0.55, np.pi, 40)])


def margin(tables, K, angles=ANGLES):
    """The least eigenvalue of the Hermitian part of the map of a frame by the documents' own reading, at some angles."""
    machine, hand = machine_of(with_numbers(tables, {"K": float(K)})), tables["ports"]["hand"]
    maps = [machine.lifted(force, hand["displacement"]) for force in hand["force"]]
    A, _, C, _ = maps[0]
    B, D = (np.stack([each[part] for each in maps], -1).reshape(len(maps[0][part]), -1) for part in (1, 3))
    ahead = np.vstack([C, C[: len(maps)] @ A])[len(maps) :], np.vstack([D, C[: len(maps)] @ B])[len(maps) :]
    moved = A, B, ahead[0] - C, ahead[1] - D
    H = np.array([at_angle(moved, angle) for angle in angles])
    return np.linalg.eigvalsh(H + np.swapaxes(H.conj(), -1, -2))[:, 0].min() / 2


def drawn(seed):
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(2, 4)), int(rng.integers(1, 5))
    roots = rng.normal(size=(3, m, m))
    M, D, S = (
        s * root @ root.T + least * np.eye(m) for root, s, least in zip(roots, (0.1, 0.5, 30), (0.05, 0.5, 20), strict=True)
    )
    normal = rng.normal(size=m)
    held = S.tolist() if rng.random() < 0.5 else []
    return M.tolist(), D.tolist(), held, normal / np.linalg.norm(normal), float(rng.uniform(0, 1)), n


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0])
def test_a_proved_port_against_the_map_of_a_march(seed):
    case = drawn(seed)
    tables = before_a_wall(*case)
    rows = wavesweep.zwidth(tables, for_hands=["port"])
    rows = rows[rows.hand == "port"]
    assert rows.certified.all() or not case[2]  # some that nothing but the wall holds are in doubt where it is soft
    tiny = 1e-12
    for row in rows.itertuples():
        inside = np.linspace(row.low, row.high, 5)[1:-1] if row.intervals else []
        assert all(margin(tables, K) > -tiny for K in inside)
        beyond = [K for K in (1.02 * row.high, 1.2 * row.high) if row.intervals and K < 3000]
        assert all(margin(tables, K) < 0 for K in beyond)


def test_margins_are_those_of_a_march_and_the_same_in_a_turned_frame():
    case = drawn(7)
    M, D, S, normal, *rest = case
    Q = np.linalg.qr(np.random.default_rng(0).normal(size=(len(M), len(M))))[0]
    whole = [Q @ np.array(each) @ Q.T if each else np.zeros((0, 0)) for each in (M, D, S)]
    turned = *(((each + each.T) / 2).tolist() for each in whole), Q @ normal, *rest
    walls = [50.0, 900.0, 2000.0]
    own, other = (before_a_wall(*each) | {"sweep": {"K": walls}} for each in (case, turned))
    found, again = wavesweep.passivity(own), wavesweep.passivity(other)
    for K, least, omega, passive in zip(walls, found.port_margin, found.port_omega, found.port_passive, strict=True):
        assert passive == (least == 0)
        assert least <= margin(own, K) + 1e-12
        assert passive or np.isclose(least, margin(own, K, np.array([omega * 1e-3 * case[-1]])), rtol=1e-7, atol=0)
    assert np.allclose(found.port_margin, again.port_margin, rtol=1e-7, atol=1e-15)
    assert (found.port_passive == again.port_passive).all()
    assert set(found.port_passive) == {True, False}


def test_axes_that_do_not_act_on_each_other_have_the_margin_of_the_worst():
    both = before_a_wall(np.diag([0.1, 0.3]).tolist(), np.diag([0.3, 0.4]).tolist(), [], [1.0, 0.0], 0.5, 3)
    one = both | {"ports": both["ports"] | {"hand": {"force": "hand_x", "displacement": "device.x"}}}
    one["wire"] = one["wire"] | {"device.fy": "-wall.fy"}
    walls = {"sweep": {"K": [20.0, 300.0, 600.0]}}
    found, expected = (wavesweep.passivity(each | walls) for each in (both, one))
    assert np.allclose(found.port_margin, expected.port_margin, rtol=1e-9, atol=1e-18)
    assert (found.port_passive == expected.port_passive).all()


def test_forces_are_held_over_the_ticks_of_the_spec():
    """Although nothing runs in three of four ticks, which intervals of stability leave out."""
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 100.0, "B": 1.0},
        "block": {
            "device": {"type": "mass", "mass": 0.1, "damping": 1.5},
            "change": {"type": "difference", "every": 4},
            "wall": {"type": "hold", "every": 4},
        },
        "wire": {"change.u": "device.x", "wall.u": "K*device.x + B*change.y", "device.f": "hand - wall.y"},
        "ports": {"hand": {"force": "hand", "displacement": "device.x"}, "wall": {"stiffness": "K", "damping": "B"}},
    }
    rows = wavesweep.zwidth(spec | {"sweep": {"K": {"start": 0, "stop": 3000}}}, for_hands=["port"])
    end = rows[rows.hand == "port"].high.item()
    table = wavesweep.passivity(spec | {"sweep": {"K": [0.99 * end, 1.01 * end]}})
    assert table.port_passive.tolist() == [True, False]
