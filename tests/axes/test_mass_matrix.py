"""Devices of several axes before flat walls, against marches in Cartesian coordinates, closed forms and turned frames."""

import numpy as np
import pytest
from meaning.judge import judge_intervals
from support.axes import before_a_wall

import wavesweep
from wavesweep.engine.errors import SpecError


def device(*case):
    """A spec of a device before a wall, whose hand pushes along x."""
    return before_a_wall(*case, along="x", most=50_000)


def drawn(seed):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(2, 4))
    roots = rng.normal(size=(3, m, m))
    M, D, S = (
        scale * root @ root.T + least * np.eye(m)
        for root, scale, least in zip(roots, (0.1, 0.5, 50), (0.02, 0, 20), strict=True)
    )
    normal = rng.normal(size=m)
    n = int(rng.integers(1, 7))
    return (
        M.tolist(),
        D.tolist(),
        S.tolist(),
        normal / np.linalg.norm(normal),
        float(rng.uniform(0, 2)),
        n,
        int(rng.integers(0, 4)),
    )


@pytest.mark.parametrize("seed", [0, 20, 39, 59])
def test_walls_of_any_direction_against_a_march(seed):
    """Of the documents' own reading, in Cartesian coordinates."""
    tables = device(*drawn(seed))
    found = judge_intervals(tables, 0, wavesweep.compile(tables))
    assert len(found) > 2
    assert [one for one in found if not one.same] == []


@pytest.mark.parametrize("seed", range(2))
def test_a_turned_frame_has_the_same_walls(seed):
    M, D, S, normal, *rest = drawn(seed)
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(M), len(M))))[0]
    turned = [(Q @ np.array(each) @ Q.T).tolist() for each in (M, D, S)]
    turned[0] = ((np.array(turned[0]) + np.array(turned[0]).T) / 2).tolist()
    found, expected = (wavesweep.zwidth(each) for each in (device(*turned, Q @ normal, *rest), device(M, D, S, normal, *rest)))
    assert np.allclose(found[["low", "high"]], expected[["low", "high"]], rtol=1e-9)


def test_coordinates_that_move_with_the_axes():
    M, D, S, normal, *rest = drawn(3)
    rng = np.random.default_rng(3)
    J, m, d = rng.normal(size=(4, len(M))), rng.uniform(0.02, 0.2, 4), rng.uniform(0, 1, 4)
    given = device(M, D, S, normal, *rest)
    given["block"]["device"] |= {"through": J.tolist(), "mass": [m.tolist()], "damping": [d.tolist()]}
    given["block"]["device"] |= {"stiffness": [[20.0] * 4]}
    whole = [J.T @ np.diag(each) @ J for each in (m, d, [20.0] * 4)]
    expected = wavesweep.zwidth(device(*(((each + each.T) / 2).tolist() for each in whole), normal, *rest))
    assert np.allclose(wavesweep.zwidth(given)[["low", "high"]], expected[["low", "high"]], rtol=1e-9)


def test_matrices_that_do_not_fit_are_refused():
    good = device([[1.0, 0.2], [0.2, 1.0]], [], [], [1.0, 0.0], 1.0, 1)
    for key, value, text in (
        ("mass", [[1.0, 2.0], [2.0, 1.0]], "symmetric and positive definite"),
        ("mass", [[1.0, 0.2], [0.1, 1.0]], "symmetric and positive definite"),
        ("damping", [[1.0, 2.0, 3.0]], "2 rows of 2 numbers or 1 row of 2 numbers, found 1 of 3"),
        ("axes", ["a", "b", "c", "d"], "1 to 3 names"),
        ("through", [[1.0]], "1 row of 2 numbers"),
    ):
        wrong = {**good["block"]["device"], key: value}
        with pytest.raises(SpecError, match=text):
            wavesweep.load(good | {"block": good["block"] | {"device": wrong}})


def test_what_is_felt_along_a_turned_normal_is_the_wall_towards_0_hz():
    """At a hand whose displacement is a share of a position, as the share along the normal; see the error that it claims."""
    c, s = np.cos(0.7), np.sin(0.7)
    spec = device([[0.12, 0.02], [0.02, 0.09]], [[0.9, 0.1], [0.1, 0.7]], [], (c, s), 1.0, 1)
    spec["wire"] |= {"device.fx": f"{c}*hand_x - wall.fx", "device.fy": f"{s}*hand_x - wall.fy"}
    spec["ports"]["hand"] = {"force": "hand_x", "displacement": "wall.depth"}
    loop = wavesweep.compile(spec)
    found = loop.response([0.0, 1e-5, 1e-4, 1e-3])
    assert found["impedance_re"].to_numpy() == pytest.approx(100.0, rel=1e-7)
    assert loop.stable_intervals(along="K", span=(0, 100))["felt_high"].item() == pytest.approx(100.0, rel=1e-9)
