"""The rows that a table has of a combination of its axes are those of a table of that loop alone, whatever the axes."""

from pathlib import Path

import numpy as np
import pytest

import wavesweep
from wavesweep.passive.table import over_frequency
from wavesweep.passive.table import passivity as passivity_table
from wavesweep.poles.table import over as poles_over
from wavesweep.program.analyses.asked import axes_asked
from wavesweep.program.spec import load

EXAMPLES = Path(__file__).parents[2] / "sweeps" / "examples"
# Plain numbers, whole ones that decide how the loop is built and, of pmw, one that the loop does not read.
LINK = {"n": [1, 2, 5], "late": [0, 1], "g": [0.1, 0.4, 0.9], "B": [6.0, 11.0]}
COUPLED = {
    "B_VE": [0.0, 1.0, 3.0], "rates.ratio": [2, 5], "b": [4.0, 20.0], "filters.lp1.order": [0, 1, 2], "K_LM": [100.0, 300.0],
}  # fmt: skip


def link():
    tables = load(EXAMPLES / "two-channel.toml").tables()
    return {name: table for name, table in tables.items() if name != "sweep"}


def coupled():
    return {"controller": {"kind": "pmw"}, "rates": {"ratio": 4}, "bode": {"frequency_hz": [0.5, 20.0]}}


def some_axes(rng, values):
    """Two or three axes with two values each, in any order."""
    names = rng.permutation(list(values))[: rng.integers(2, 4)].tolist()
    return {name: rng.permutation(values[name])[:2].tolist() for name in names}


def with_axes(tables, axes, along=None):
    return load(tables | {"sweep": axes | (along or {})})


def passivity_ports(spec, axes):
    return over_frequency(with_axes(spec, axes)).columns


def passivity(spec, axes):
    return passivity_table(with_axes(spec, axes), jobs=1).columns


def stability_region(spec, axes):
    along = "g" if "block" in spec and "g" not in axes else "device.mass" if "block" not in spec else "K"
    return wavesweep.compile(spec).stable_intervals(along, (0.05, 2.0), **axes).to_dict("list")


def responses(spec, axes):
    return wavesweep.compile(spec).response([0.5, 20.0], **axes).to_dict("list")


def found_alone(table, spec, axes, columns):
    """The columns, each combination computed by a table of its own: the values are those of the spec, and there is no axis."""
    names = list(axes)
    combinations = list(dict.fromkeys(zip(*(np.asarray(columns[name]).tolist() for name in names), strict=True)))
    for combination in combinations:
        rows = np.all([np.asarray(columns[name]) == value for name, value in zip(names, combination, strict=True)], axis=0)
        yield combination, rows, table(spec, {name: [value] for name, value in zip(names, combination, strict=True)})
    assert combinations == [
        tuple(row) for row in np.stack(np.meshgrid(*axes.values(), indexing="ij"), -1).reshape(-1, len(axes))
    ]


@pytest.mark.parametrize("table", [passivity_ports, passivity, stability_region, responses])
@pytest.mark.parametrize("seed", range(3))
def test_rows_of_a_combination_are_those_of_its_loop(table, seed):
    drawn = table is passivity_ports or seed == 1
    rng = np.random.default_rng(seed)
    spec, axes = (link(), some_axes(rng, LINK)) if drawn else (coupled(), some_axes(rng, COUPLED))
    if table is stability_region:
        axes.pop("K", None)
    columns = table(spec, axes)
    for combination, rows, alone in found_alone(table, spec, axes, columns):
        for name, column in alone.items():
            found, expected = np.asarray(columns[name])[rows], np.asarray(column)
            if expected.dtype.kind == "f":
                np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9, err_msg=f"{name} at {combination}")
            else:
                assert found.tolist() == expected.tolist(), (name, combination)


@pytest.mark.parametrize(("spec", "name"), [(link, "n"), (link, "B"), (coupled, "rates.ratio"), (coupled, "b")])
def test_poles_of_a_value_are_those_of_its_loop(spec, name):
    values = (LINK | COUPLED)[name]
    (axis,) = axes_asked(load(spec()), {name: values})
    columns = poles_over(load(spec()), axis).columns
    for value in values:
        alone = poles_over(load(spec(), [f"{name}={value}"])).columns
        rows = np.asarray(columns[name]) == value
        np.testing.assert_allclose(np.asarray(columns["radius"])[rows], alone["radius"], rtol=1e-9)
