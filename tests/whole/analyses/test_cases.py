"""Loops with their stable intervals, in `tests/whole/cases`, against eigenvalues of a march through a frame.

A case has a `story`, the tables of its `spec`, the number `along` which intervals are looked for within `span`, perhaps other
`axes`, and `rows` in the order of the table: low end, high end (nan for none) and whether the row is certified. `felt` has the
stiffness that the hand feels at both ends. A row that is not certified may become certified, if it is then right. `march` is
false if doubles lose the loop's digits, so that the ends are those of ball arithmetic alone.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.monodromy import verdict

import wavesweep
from wavesweep.program.spec import load

CASES = {
    f"{path.stem}-{number}": case
    for path in sorted((Path(__file__).parents[1] / "cases").glob("*.toml"))
    for number, case in enumerate(tomllib.loads(path.read_text(encoding="utf-8"))["case"])
}
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


def compared_with_a_march(spec, case, rows):
    """Inside of every interval the march decays, outside it grows, and where nothing is stable it grows everywhere."""
    path, (low, high) = spec.names.find(case["along"]).path, case["span"]

    def told(value):
        return verdict(spec.with_values({path: float(value)}), {})

    if not rows["intervals"].iloc[0]:
        assert all(told(value) <= 0 for value in np.linspace(low, high, 7)[1:-1]), case["story"]
    for row in rows[rows["intervals"] > 0].itertuples():
        assert told((row.low + row.high) / 2) >= 0, case["story"]
        for end, omega, inward in ((row.low, row.low_omega, 1), (row.high, row.high_omega, -1)):
            if np.isnan(omega) or not low < end < high:
                continue
            steps = inward * STEPS * max(abs(end), 1e-3 * (high - low))
            assert any((told(end + step), told(end - step)) == (1, -1) for step in steps), case["story"]
