"""[for_all] contact: the key, the rows of tables, and the line of `check`."""

import re
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from meaning.specs import toml

import wavesweep
from tests.contact.test_proof import FIG4, SLOW
from wavesweep import SpecError, UsageError
from wavesweep.contact.rows import LINEAR
from wavesweep.contact.verdict import of_wall
from wavesweep.program.cli import main
from wavesweep.program.spec import load
from wavesweep.program.tables.frame import framed
from wavesweep.program.tables.interval_table import intervals

pytestmark = pytest.mark.asks("for_all")
SWEEP = {"K_VE": {"start": 0, "stop": 2000}}
PIECES = FIG4 | {"controller": {"kind": "pmw", "b": 20.0}, "environment": FIG4["environment"] | {"delay": 10}}
DRAWN = {
    "rates": {"tick_hz": 1000},
    "numbers": {"k": 100.0, "b": 0.3},
    "block": {"handle": {"type": "mass", "mass": 0.1, "damping": 1.5}, "wall": {"type": "hold", "every": 20}},
    "wire": {"wall.u": "k*handle.x + b*handle.v", "handle.f": "f_h - wall.y"},
    "ports": {"hand": {"force": "f_h", "displacement": "handle.x"}, "wall": {"stiffness": "k", "damping": "b"}},
    "sweep": {"k": {"start": 0, "stop": 2000}},
}


def spec_of(tables, **more):
    """A spec with contact."""
    return load({**tables, "sweep": SWEEP, "for_all": {"contact": True}} | more)


def contact_rows(spec):
    """The rows of contact of a table, which have no characteristic equation."""
    frame = framed(intervals(spec))
    rows = frame[frame["guarantee"] == "contact"]
    assert rows["residual"].isna().all()
    return rows


def test_rows_of_contact_stand_beside_those_of_the_linear_wall():
    """Figure 4 at four dampings: each proof ends next to what is refuted."""
    spec = spec_of(FIG4, sweep={**SWEEP, "B_VE": [0, 1, 5, 10]})
    frame = framed(intervals(spec))
    own, rows = (frame[frame["guarantee"] == word] for word in ("spec", "contact"))
    share = rows["high"].to_numpy() / own["high"].to_numpy()
    assert share == pytest.approx([0.622, 0.759, 0.9998, 0.9998], abs=2e-3)
    assert (rows["low"] == 0).all()
    assert rows["certified"].all()
    assert rows["settled"].all()
    assert (rows["fails_from"] > rows["high"]).all()
    assert (rows["fails_from"] < 1.01 * rows["high"]).all()
    texts = rows["counterexample"].tolist()
    assert [text == LINEAR for text in texts] == [False, False, True, True]
    assert texts[0].startswith("a wall through (")


@pytest.mark.parametrize(
    ("tables", "stiffness", "stop", "settled"),
    [(FIG4, 500, 50, True), (PIECES, 500, 50, True), (SLOW, 240, 50, True), (SLOW, 240, 1, False)],
)
def test_intervals_along_the_damping_are_proved_too(tables, stiffness, stop, settled):
    """What is proved next to an end along B_VE, in pieces or at once, is so along K_VE, and nothing beyond it."""
    sweep = {"along": "B_VE", "B_VE": {"start": 0, "stop": stop}, "K_VE": [stiffness]}
    (row,) = contact_rows(spec_of(tables, sweep=sweep)).itertuples()
    assert 0.97 * row.low < row.fails_below < row.low
    assert row.settled == settled
    environment = tables.get("environment", {})
    along = [
        contact_rows(spec_of({**tables, "environment": environment | {"B_VE": damping}}))
        for damping in (row.fails_below, 1.01 * row.low)
    ]
    assert along[0]["high"].max() < 1.001 * stiffness < 1.002 * along[1]["high"].max()


def test_a_loop_that_is_unstable_without_its_wall_has_no_row():
    """A local model that is too stiff: the wall that is never touched is one of the walls."""
    spec = spec_of({"controller": {"kind": "dc-lm"}, "local_model": {"K_LM": 4e4}})
    (row,) = contact_rows(spec).itertuples()
    assert (row.intervals, row.certified, row.settled) == (0, True, True)
    assert row.counterexample.startswith("without its wall the loop is unstable: spectral radius ")
    assert of_wall(spec) == {"verdict": "refuted", "counterexample": f"no contact at all: {row.counterexample}"}


def test_a_row_of_a_loop_that_the_proof_is_not_about_says_that_it_is_in_doubt():
    """Nothing brakes the handle: without its wall it has two poles at 1."""
    handle = {"type": "mass", "mass": 0.1}
    block = DRAWN["block"] | {"handle": handle}
    (row,) = contact_rows(spec_of(DRAWN, block=block, sweep=DRAWN["sweep"])).itertuples()
    assert (row.intervals, row.certified, row.doubt) == (0, False, "search")


def test_contact_that_is_false_is_not_asked_for():
    assert not spec_of(FIG4, for_all={"contact": False}).contact
    assert spec_of(FIG4).contact


def test_hands_beside_contact_are_refused(tmp_path, capsys):
    (tmp_path / "spec.toml").write_text(toml(FIG4 | {"sweep": SWEEP, "for_all": {"contact": True}}))
    assert main(["zwidth", str(tmp_path / "spec.toml"), "--for-hands", "passive", "--out", str(tmp_path)]) == 2
    assert "expected no --for-hands, since its rows are of the spec's own hand, found passive" in capsys.readouterr().err


NET = DRAWN | {
    "block": DRAWN["block"] | {"net": {"type": "channel", "every": 20, "lost": 1}},
    "wire": DRAWN["wire"] | {"net.u": "wall.y"},
}


@pytest.mark.parametrize(
    ("tables", "beside", "found"),
    [
        (FIG4, {"device.mass": {"start": 0.09, "stop": 0.1}}, "a range of device.mass"),
        (FIG4, {"loss": 0.1, "b": [9, 10]}, "for_all.loss"),
        (NET, {}, "channel net"),
    ],
)
def test_contact_is_refused_beside_what_its_proof_is_not_about(tables, beside, found):
    said = f"or no contact, found {found} beside it"
    with pytest.raises(SpecError, match=re.escape(said)):
        load({**tables, "sweep": tables.get("sweep", SWEEP), "for_all": {"contact": True} | beside})


@pytest.mark.parametrize(
    ("tables", "more", "text"),
    [
        (FIG4, {"sweep": {"along": "b", "b": {"start": 1, "stop": 50}}}, "found controller.b"),
        (DRAWN | {"ports": {}}, {"sweep": {"along": "k", "k": [0, 9]}}, "the numbers of a wall"),
        (FIG4, {"sweep": SWEEP, "rates": {"slow_hz": 60}}, "several times in it"),
    ],
    ids=["along another number", "no wall", "rates that do not divide"],
)
def test_what_the_proof_is_not_about_is_refused(tables, more, text):
    if "wire" in tables and not tables["ports"]:
        tables = tables | {"wire": {"wall.u": "k*handle.x + b*handle.v", "handle.f": "-wall.y"}}
    with pytest.raises(UsageError) as refused:
        intervals(spec_of(tables, **more))
    assert text in str(refused.value)


@pytest.mark.parametrize(("stiffness", "damping", "expected"), [(430, 0, "proved"), (450, 0, "refuted"), (1300, 5, "refuted")])
def test_the_verdict_on_the_own_wall(stiffness, damping, expected):
    wall = {"K_VE": stiffness, "B_VE": damping}
    spec = spec_of({**FIG4, "environment": {**FIG4["environment"], **wall}})
    found = of_wall(spec)
    assert found["verdict"] == expected
    assert (found["counterexample"] == LINEAR) == (damping == 5)


@pytest.mark.slow
def test_the_example_draws_a_wall_that_goes_on_and_two_that_rest(tmp_path):
    path = Path("sweeps/examples/contact.py").resolve()
    made = spec_from_file_location("contact_example", path)
    example = module_from_spec(made)
    made.loader.exec_module(example)
    example.main(tmp_path)
    assert (tmp_path / "contact.png").stat().st_size > 10_000
    loop = wavesweep.compile(example.SPEC)
    rows = loop.stable_intervals(along="K_VE", span=(0, 2000), B_VE=[example.DAMPING])
    row = rows[rows["guarantee"] == "contact"].iloc[0]
    readings, forces, push = example.counterexample(row)
    start = example.begin(row.fails_from, readings, forces, push)
    wall = example.curve(readings, forces)
    assert np.ptp(example.march(row.fails_from, wall, push, *start)[-20:]) > 1.9
    assert np.ptp(example.march(0.95 * row.high, wall, push, *start)[-20:]) < 1e-3
