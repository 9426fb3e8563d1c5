"""Claims about numbers that matter together are held against an own climb over their members."""

import numpy as np
import pytest
from support import together

import wavesweep

POINTS = 3  # members of a loop that are computed in both ways


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", together.KINDS)
def test_matrices_of_members_are_those_of_the_loop(name, seed):
    rng = np.random.default_rng([seed, 11])
    loop = together.KINDS[name](rng)
    tables = {key: table for key, table in loop.tables.items() if key != "for_all"}
    units = rng.uniform(-1, 1, (POINTS, len(loop.numbers)))
    points = np.stack([each.at(units[:, i]) for i, each in enumerate(loop.numbers)], -1)
    for point, matrix in zip(points, loop.maps(points, 0.7)[0], strict=True):
        own = dict(zip((each.name for each in loop.numbers), point.tolist(), strict=True))
        member = wavesweep.compile(tables | {"numbers": {**tables["numbers"], **own, "A": 0.7}})
        radius = np.abs(np.linalg.eigvals(matrix)).max()
        assert member.spectral_radius() == pytest.approx(radius, rel=1e-9)


def test_a_climb_finds_the_worst_member_of_two_sines_in_a_ring():
    """Its radius is the root of the product of both gains, largest at right angles."""
    numbers = [together.Number("p", 0, 6.3), together.Number("q", 0, 6.3)]

    def maps(points, amplitude):
        ring = np.zeros((1, len(points), 2, 2))
        ring[0, :, 0, 1] = amplitude * np.sin(points[:, 0])
        ring[0, :, 1, 0] = np.sin(points[:, 1])
        return ring

    alone = together.Varies("alone", {})
    loop = together.Together("ring", numbers, np.zeros((0, 2)), {}, maps, alone)
    worst, place = loop.climb(1.1)
    assert worst == pytest.approx(np.sqrt(1.1), rel=1e-6)
    assert np.abs(np.sin(place)) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
@pytest.mark.sample(2)
@pytest.mark.parametrize("name", together.KINDS)
def test_claims_give_way_where_numbers_are_unstable_only_together(name):
    loop = together.drawn(name, 0)
    found = together.judged(loop)
    assert not found["wrong"], (found, loop.tables)
    assert found["said"] == "refuted", (found, loop.tables)
