"""Loops with their stable intervals, in `tests/whole/cases`, against eigenvalues of a march through a frame.

A case has a `story`, the tables of its `spec`, the number `along` which intervals are looked for within `span`, perhaps other
`axes`, and `rows` in the order of the table: low end, high end (nan for none) and whether the row is certified. `felt` has the
stiffness that the hand feels at both ends. A row that is not certified may become certified, if it is then right. `march` is
false if doubles lose the loop's digits, so that the ends are those of ball arithmetic alone.
"""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import wavesweep
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import loops_of
from wavesweep.simulation.running_blocks import DEPTH, FORCE, SPEED, loop_of
from wavesweep.simulation.tick_sums import TickSums, keep, run

CASES = {
    f"{path.stem}-{number}": case
    for path in sorted((Path(__file__).parents[1] / "cases").glob("*.toml"))
    for number, case in enumerate(tomllib.loads(path.read_text(encoding="utf-8"))["case"])
}
NEAR = 1e-7  # of the circle: a point this near to an end says nothing; of 1: an eigenvalue that may be drift
ROUNDED = 1e-12  # of 1: an eigenvalue that is drift but for rounding
STEPS = 10.0 ** np.arange(-7, 0)  # of an end, how far from it the march is asked: rounding hides the nearest


@pytest.fixture(scope="module", params=CASES)
def case(request):
    """A case, its spec, and the table of its intervals."""
    case = CASES[request.param]
    spec = load(case["spec"])
    return case, spec, wavesweep.compile(spec).stable_intervals(case["along"], tuple(case["span"]), **case.get("axes", {}))


@pytest.mark.slow
def test_a_drawn_loop_has_its_ends(case):
    case, spec, table = case
    *ends, certified = (np.array(each, float) for each in zip(*case["rows"], strict=True))
    if certified.all():
        assert table.certified.all(), case["story"]
        near = 1e-14 * np.ptp(case["span"])
        np.testing.assert_allclose(table[["low", "high"]].to_numpy().T, ends, rtol=1e-9, atol=near, err_msg=case["story"])
        if "felt" in case:
            np.testing.assert_allclose(table[["felt_low", "felt_high"]], case["felt"], rtol=1e-7, atol=1e-9)
    elif not table.certified.any():
        return
    for rows, there in slices(case, spec, table) if case.get("march", True) else ():
        compared_with_a_march(there, case, rows)


@pytest.mark.slow
def test_a_slice_of_a_sweep_has_what_it_has_alone(case):
    case, spec, table = case
    names = ["low", "high", "low_omega", "high_omega", "felt_low", "felt_high"]
    for rows, there in slices(case, spec, table)[:3] if len(table) > 1 else ():
        alone = wavesweep.compile(there).stable_intervals(case["along"], tuple(case["span"]))
        near = 1e-12 * np.ptp(case["span"])
        np.testing.assert_allclose(rows[names], alone[names], rtol=1e-8, atol=near, err_msg=case["story"])


def slices(case, spec, table):
    """The rows of each slice that is certified, and the spec with the numbers of the slice."""
    names = list(case.get("axes", {}))
    parts = [rows for _, rows in table.groupby(names or ["along"]) if rows.certified.all()]
    return [(rows, spec.with_values({name: rows[name].iloc[0].item() for name in names})) for rows in parts]


def monodromy(drawing, values):
    """The map of states and held outputs over a frame, from a run of the blocks on unit numbers."""
    ticks = TickSums(replace(loop_of(drawing, values), inputs=(), hand=""))
    programs = [ticks.program(k, frozenset(), touching=True) for k in range(ticks.loop.frame)]
    kept = [place for name, place in ticks.places.items() if name.partition(".")[0] in {part.name for part in ticks.blocks}]
    z = [np.zeros(len(kept)) for _ in ticks.places]
    for place, unit in zip(kept, np.eye(len(kept)), strict=True):
        z[place] = unit
    for program in programs:
        run(program.first, z, {})
        if program.wall:
            depth, speed, force = (ticks.place(name) for name in (DEPTH, SPEED, FORCE))
            z[force] = program.wall.force(z[depth], z[speed])[0]
            run(program.second, z, {})
        keep(program, z)
    return np.array([np.broadcast_to(z[place], len(kept)) for place in kept])


def compared_with_a_march(spec, case, rows):
    """Inside of every interval the march decays, outside it grows, and where nothing is stable it grows everywhere."""
    path, (low, high) = spec.names.find(case["along"]).path, case["span"]

    def told(value):
        """1 if every mode decays, -1 if not, 0 if one is too near to tell."""
        values = dict(spec.values) | {path: float(value)}
        known = {key: number for key, number in values.items() if number is not None}
        z = np.linalg.eigvals(monodromy(loops_of(spec, values).drawing, known))
        # A drift is exactly 1; what rounding makes of several is no instability, nor what creeps a proof of it.
        distance = np.abs(z - 1)
        largest = np.abs(z)[distance > NEAR].max(initial=0.0)
        creeps = ((distance > ROUNDED) & (distance <= NEAR)).any()
        return 0 if abs(largest - 1) < NEAR or (creeps and largest < 1) else 1 if largest < 1 else -1

    if not rows["intervals"].iloc[0]:
        assert all(told(value) <= 0 for value in np.linspace(low, high, 7)[1:-1]), case["story"]
    for row in rows[rows["intervals"] > 0].itertuples():
        assert told((row.low + row.high) / 2) >= 0, case["story"]
        for end, omega, inward in ((row.low, row.low_omega, 1), (row.high, row.high_omega, -1)):
            if np.isnan(omega) or not low < end < high:
                continue
            steps = inward * STEPS * max(abs(end), 1e-3 * (high - low))
            assert any((told(end + step), told(end - step)) == (1, -1) for step in steps), case["story"]
