"""The stiffness felt at the ends of intervals, against the static response of the loop there."""

import numpy as np
import pytest
from support.specs import nested, values_of

import wavesweep
from wavesweep import sweep
from wavesweep.analysis.response import prepare, static_response
from wavesweep.diagram import draw

KEYS = {"K_VE": "environment.K_VE", "B_VE": "environment.B_VE", "b": "controller.b"}


def felt_at(values, **changes):
    changed = values | {KEYS[name]: value for name, value in changes.items()}
    return float(static_response(prepare(draw(changed), changed["environment.K_VE"], changed["environment.B_VE"]))[1])


@pytest.mark.parametrize(("along", "span"), [("K_VE", (10, 20000)), ("B_VE", (0, 30)), ("b", (2, 100))])
def test_it_is_the_static_impedance_at_that_end(along, span):
    values = values_of("pmw", integration="explicit", delay=20, velocity="difference", K_VE=150.0)
    others = {name: axis for name, axis in {"b": [10.0, 25.0], "B_VE": [0.5, 2.0]}.items() if name != along}
    table = wavesweep.compile(nested(values)).stable_intervals(along, span, **others)
    assert (table["intervals"] > 0).all()
    for _, row in table.iterrows():
        place = {name: row[name] for name in others}
        for end in ("low", "high"):
            assert row[f"felt_{end}"] == pytest.approx(felt_at(values, **(place | {along: row[end]})), rel=1e-9)


def test_direct_coupling_feels_the_wall_itself():
    table = wavesweep.compile({"controller": {"kind": "dc-slow"}}).stable_intervals(B_VE=[0.0, 1.0])
    stable = table["intervals"] > 0
    assert table["felt_high"][stable].to_numpy() == pytest.approx(table["high"][stable].to_numpy(), rel=1e-9)
    assert (table["felt_low"][stable] == 0).all()
    assert table["felt_high"][~stable].isna().all()


def test_a_wave_line_is_ranked_otherwise_than_its_walls():
    """The largest wall is rendered at a small wave impedance, where little of it is felt."""
    spec = wavesweep.load({
        "controller": {"kind": "pmw"}, "rates": {"ratio": 33},
        "device": {"mass": 0.045, "damping": 0.5}, "environment": {"integration": "explicit"},
        "sweep": {"K_VE": {"start": 0, "stop": 20000}, "b": [2.3, 25.0, 60.0]},
    })  # fmt: skip
    columns = sweep.intervals(spec, along="K_VE").columns
    first = columns["interval"] == 0
    assert np.argsort(columns["high"][first]).tolist() == [2, 1, 0]
    assert np.argsort(columns["felt_high"][first]).tolist() == [0, 1, 2]
    assert (columns["felt_high"][first] < columns["high"][first]).all()
