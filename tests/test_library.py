"""The calls that do what the commands do."""

import pickle
import re
import tomllib
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas
import pytest

import wavesweep
from wavesweep.errors import UsageError
from wavesweep.loops.multirate import MultirateLoop
from wavesweep.spec import load
from wavesweep.tables.responses import responses

SPEC = {
    "controller": {"kind": "pmw"},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}, "B_VE": [0.5, 1.0], "b": [10.0, 25.0]},
    "bode": {"frequency_hz": [0.0, 1.0]},
    "simulate": {"duration_s": 0.5},
}
WHEEL = Path(__file__).parents[1] / "sweeps" / "recipes" / "wheel.toml"
VARIED = {"b": {"start": 5.0, "stop": 80.0}}
WISHED = {
    "controller": {"kind": "pmw"},
    "design": {"vary": VARIED, "wish": {"z_width": {}}, "population": 8, "generations": 1},
}


def test_every_name_is_there_and_has_a_docstring():
    for name in wavesweep.__all__:
        assert getattr(wavesweep, name) is not None
        assert name == "__version__" or getattr(wavesweep, name).__doc__


def test_the_spec_s_own_sweep_is_a_table_with_units_and_facts():
    table = wavesweep.zwidth(SPEC, jobs=1)
    assert list(table.columns[:2]) == ["B_VE", "b"]
    assert table.attrs["units"]["high"] == "N/m"
    assert table.attrs["units"]["B_VE"] == "N*s/m"
    assert table.attrs["facts"]["slices"]["computed"] == 4
    alone = wavesweep.compile(SPEC).stable_intervals(B_VE=[0.5, 1.0], b=[10.0, 25.0], span=(0, 2000))
    pandas.testing.assert_frame_equal(table, alone, check_like=True)
    assert alone.attrs["units"] == table.attrs["units"]


def turning(path, **more):
    """The tables of a spec of the wheel, with the units of those that the functions return."""
    tables = tomllib.loads(Path(path).read_text())
    tables["bode"] = {"frequency_hz": [1.0, 5.0]}
    tables["simulate"] = {"duration_s": 0.5, "input": "pulse"}
    return tables | more


def test_the_hand_of_a_loop_that_turns_has_torques_and_angles():
    """The numbers are those of the same loop that slides: only the units differ."""
    turned, slid = turning(WHEEL), turning(WHEEL)
    assert slid["ports"]["hand"].pop("turns")
    for function, units, same in (
        (wavesweep.bode, {"admittance_abs": "rad/(N*m)", "impedance_re": "N*m/rad", "worst_gain": "rad/(N*m)"}, []),
        (
            wavesweep.passivity,
            {"port_margin": "rad/(N*m)", "damping_needed": "N*m*s/rad", "port_omega": "rad/s"},
            ["port_omega"],
        ),
        (
            lambda source: wavesweep.simulate(source)[0],
            {"f_h": "N*m", "x": "rad", "v": "rad/s", "energy_hand": "J", "time_s": "s"},
            ["energy_hand", "time_s"],
        ),
    ):
        first, second = function(turned), function(slid)
        assert {name: first.attrs["units"][name] for name in units} == units
        assert [name for name, unit in units.items() if second.attrs["units"][name] == unit] == same
        pandas.testing.assert_frame_equal(first, second)
    assert wavesweep.bode(turned, slid).attrs["units"]["admittance_abs"] == ""
    assert wavesweep.bode(turned, turned).attrs["units"]["admittance_abs"] == "rad/(N*m)"


def test_what_is_felt_of_a_wall_without_a_unit_is_of_a_torque():
    tables = turning(WHEEL, sweep={"along": "K", "K": {"start": 0, "stop": 400}})
    tables["numbers"] |= {"K": 10.0, "B": 0.0}
    tables["ports"]["wall"] = {"stiffness": "K", "damping": "B"}
    assert wavesweep.zwidth(tables).attrs["units"]["felt_high"] == "N*m/rad"
    assert load(tables).units_felt == ("N*m/rad", "N*m*s/rad")


def test_a_column_shares_what_is_known_of_its_table():
    """pandas copies `.attrs` at every access to a column, whatever their size; who unpickles a table needs no wavesweep."""
    table = wavesweep.zwidth(SPEC, jobs=1)
    assert table["low"].attrs["facts"] is table.attrs["facts"]
    assert {type(part) for part in pickle.loads(pickle.dumps(table)).attrs.values()} == {dict}  # noqa: S301 - its own


def test_hands_are_an_option():
    table = wavesweep.zwidth(
        SPEC | {"controller": {"kind": "dc"}, "device": {"velocity": "difference"}}, for_hands="passive", jobs=1
    )
    assert set(table["hand"]) == {"free", "passive"}


@pytest.mark.slow
def test_the_other_commands_have_a_call_each():
    assert set(wavesweep.bode(SPEC)["frequency_hz"]) == {0.0, 1.0}
    assert wavesweep.passivity(SPEC, jobs=1)["damping_needed"].isna().all()
    assert wavesweep.filter_choices(SPEC).attrs["units"]["lp1_cutoff_hz"] == "Hz"
    assert len(wavesweep.simulate(SPEC)[0]) == 500
    region = wavesweep.stability_region({**SPEC, "sweep": {"along": "b", "b": {"start": 5, "stop": 50}}}, jobs=1)
    assert region["along"].tolist() == ["b"] * len(region)


def test_a_loop_prints_as_a_person_would_want_it():
    assert repr(wavesweep.compile(SPEC)) == (
        "<Loop spec: pmw, 4 states, frame of 20 ticks, 20 ms; K_VE = 500, B_VE = 1, Kp = 0, b = 25>"
    )


def test_errors_can_be_caught_by_name():
    with pytest.raises(wavesweep.SpecError):
        wavesweep.zwidth({"controller": {"kind": "nothing"}})
    assert issubclass(wavesweep.SpecError, wavesweep.UsageError)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda spec: wavesweep.zwidth(spec, jobs=0), "jobs: expected a whole number >= 1, found 0"),
        (
            lambda spec: wavesweep.zwidth(spec, workers=2),
            "workers: expected one of the arguments jobs, backend, scheduler,",
        ),
        (
            lambda _: wavesweep.design(WISHED, workers=2),
            "workers: expected one of the arguments jobs, backend, scheduler,",
        ),
        (lambda spec: wavesweep.zwidth(spec, jobs=1.5), "found 1.5"),
        (lambda spec: wavesweep.zwidth(spec, scheduler="tcp://there:8786"), "backend"),
        (lambda spec: wavesweep.zwidth(spec, for_hands="nope"), "expected passive, box, port or box:RANGES, found 'nope'"),
        (lambda spec: wavesweep.zwidth(spec, for_hands="passive:mass=0..1"), "found 'passive:mass=0..1'"),
        (lambda spec: wavesweep.zwidth(spec, for_hands="box:x=0..1"), "(mass, damping, stiffness), found 'x=0..1'"),
        (lambda _: wavesweep.bode(), "at least one spec"),
        (lambda spec: wavesweep.zwidth(spec, jobs=True), "jobs: expected a whole number >= 1, found True"),
        (lambda _: wavesweep.design(WISHED, jobs=0), "jobs: expected a whole number >= 1, found 0"),
        (lambda _: wavesweep.design(WISHED, checkpoint=5), "checkpoint: expected a file, found 5"),
        (lambda _: wavesweep.design(WISHED, scheduler="tcp://there:8786"), 'expected backend = "dask"'),
        (lambda _: wavesweep.design(WISHED, for_hands="nope"), "for_hands: expected one of vertices, box, found 'nope'"),
        (lambda spec: wavesweep.zwidth(spec, force="no"), "force: expected True or False, found 'no'"),
        (lambda spec: wavesweep.bode(spec, force=0), "force: expected True or False, found 0"),
        (lambda spec: wavesweep.passivity(spec, force="no"), "force: expected True or False, found 'no'"),
        (lambda _: wavesweep.design(WISHED, force="no"), "force: expected True or False, found 'no'"),
        (lambda _: wavesweep.results.publish(None, ".", overwrite="no"), "overwrite: expected True or False, found 'no'"),
        (lambda _: wavesweep.results.publish(None, ".", locked=1), "locked: expected True or False, found 1"),
        (lambda _: wavesweep.results.at_work(["zwidth"], ".", wait=1).__enter__(), "wait: expected True or False, found 1"),
    ],
)
def test_arguments_that_mean_nothing_are_refused(call, says):
    spec = {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 100}, "b": [20, 30]}}
    with pytest.raises(wavesweep.UsageError, match=re.escape(says)):
        call(spec)


def test_a_checkpoint_may_be_named_by_a_text(tmp_path):
    spec = {"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 100}, "b": [20, 30]}}
    assert len(wavesweep.zwidth(spec, checkpoint=str(tmp_path / "parts"))) == 2
    assert len(wavesweep.design(WISHED, checkpoint=str(tmp_path / "design"), jobs=1)) == 1


@pytest.mark.parametrize("source", [None, 1, [], np.zeros(2), "nowhere.toml"])
def test_a_source_that_is_none_is_refused(source):
    with pytest.raises(UsageError):
        wavesweep.load(source)


def test_tables_that_contain_themselves_are_refused():
    tables = {"controller": {"kind": "pmw"}}
    tables["controller"]["more"] = tables
    with pytest.raises(UsageError, match="contains itself"):
        wavesweep.load(tables)


@pytest.mark.parametrize(
    "call",
    [
        lambda loop: loop.stable_intervals(1.5),
        lambda loop: loop.stable_intervals(["K_VE"]),
        lambda loop: loop.stable_intervals(span=(0, 10**400)),
        lambda loop: loop.stable_intervals(span=(0, 5e-324)),
        lambda loop: loop.stable_intervals(B_VE=[[1.0, 2.0], [3.0, 4.0]]),
        lambda loop: loop.spectral_radius(b=np.ones((2, 2))),
        lambda loop: loop.response("x"),
        lambda loop: loop.response([[1.0], [1.0, 2.0]]),
        lambda loop: loop.response(1j),
        lambda loop: loop.response("1"),
        lambda loop: loop.response(["1", "2"]),
        lambda loop: loop.response(True),
        lambda loop: loop.response([1.0, True]),
        lambda loop: loop.response(np.array([True])),
        lambda loop: loop.response(np.ma.array([1.0, 2.0], mask=[False, True])),
        lambda loop: loop.stable_intervals(span=("0", "10")),
        lambda loop: loop.stable_intervals(span="09"),
        lambda loop: loop.stable_intervals(span=(False, True)),
        lambda loop: loop.stable_intervals(span=(0, True)),
        lambda loop: loop.stable_intervals(b=[1.0, True]),
        lambda loop: loop.stable_intervals(b=True),
        lambda loop: loop.spectral_radius(b=["1"]),
        lambda loop: loop.simulate(["1", "2"]),
        lambda loop: loop.simulate([True, False]),
        lambda loop: loop.simulate(np.ones(3), wall=True),
        lambda loop: loop.simulate(np.ones(3), wall="0.1"),
        lambda loop: loop.simulate(np.ones(3), wall=[0.1, 0.2]),
        lambda loop: wavesweep.passivity(loop.spec, tolerance=True),
        lambda loop: wavesweep.zwidth(loop.spec, for_hands="box:mass=nan..1"),
        lambda loop: wavesweep.zwidth(loop.spec, for_hands={"mass": (0, 1)}),
        lambda loop: loop.simulate("x"),
        lambda loop: wavesweep.zwidth(loop.spec, along=3.0),
        lambda loop: wavesweep.zwidth(loop.spec, for_hands=1),
        lambda loop: wavesweep.zwidth(loop.spec, for_hands=[["box"]]),
        lambda loop: wavesweep.passivity(loop.spec, tolerance="x"),
        lambda loop: wavesweep.filter_choices(loop.spec, tolerance=-1.0),
    ],
)
def test_arguments_of_other_kinds_are_refused(call):
    with pytest.raises(UsageError):
        call(wavesweep.compile({"controller": {"kind": "pmw"}}))


def test_numbers_may_come_as_ranges_series_and_fractions():
    loop = wavesweep.compile(SPEC)
    whole = loop.response(range(1, 3))
    for same in ([1, 2], pandas.Series([1.0, 2.0]), (Fraction(1), np.int64(2)), np.array([1, 2], object)):
        assert loop.response(same).equals(whole)
    table = wavesweep.zwidth({**SPEC, "sweep": {**SPEC["sweep"], "b": range(10, 30, 10)}})
    assert table.equals(wavesweep.zwidth({**SPEC, "sweep": {**SPEC["sweep"], "b": [10, 20]}}))
    with pytest.raises(wavesweep.SpecError, match=r"sweep\.b: expected a list of numbers .*, found range\(1, 1000"):
        wavesweep.load({**SPEC, "sweep": {"b": range(1, 10**30)}})


@pytest.mark.parametrize("text", ["", "a,b\n1,2,3\n", "a,a\n1,2\n"])
def test_a_file_that_is_no_table_is_refused(text, tmp_path):
    for name in ("zwidth.csv", "zwidth.parquet"):
        (tmp_path / name).write_text(text)
    for name in ("zwidth.csv", "zwidth.parquet")[text.startswith("a,a") :]:
        with pytest.raises(UsageError, match="expected a whole table"):
            wavesweep.results.read(tmp_path / name)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: wavesweep.compile(3), "expected a path, or nested tables as a dict, found 3"),
        (lambda: wavesweep.zwidth({"controller": {"kind": "dc"}}, checkpoint=3), "checkpoint: expected a file, found 3"),
        (lambda: wavesweep.results.read(None), "expected the path of a CSV or Parquet file, found None"),
        (
            lambda: wavesweep.compile({"controller": {"kind": "dc"}}).spectral_radius(**{"controller.kind": ["dc"]}),
            r"controller\.kind: expected the name of a numeric key, did you mean controller\.(?!kind)",
        ),
        (lambda: _direct().simulate([0.0] * 10, resolution=None), "option resolution: expected a finite number, found None"),
        (lambda: _direct().simulate([0.0] * 10, seed=1.5), "option seed: expected a whole number, found 1.5"),
        (lambda: _direct().response([1.0, -2.0]), r"frequency_hz: expected finite numbers >= 0, found -2\.0"),
        (lambda: wavesweep.compile(MultirateLoop(1e-3, (), {})), "a drawn loop: expected at least one block, found none"),
        (lambda: _publish(partition=0), "partition: expected a whole number of rows >= 1, found 0"),
        (lambda: _publish(partition=2.5), r"partition: expected a whole number of rows >= 1, found 2\.5"),
    ],
)
def test_what_is_no_path_and_no_number_is_refused_in_a_sentence(call, message):
    with pytest.raises(wavesweep.UsageError, match=message):
        call()


def _direct():
    return wavesweep.compile({"controller": {"kind": "dc"}})


def _publish(**options):
    wavesweep.results.publish(responses([load({"controller": {"kind": "dc"}})]), "nowhere", **options)


def test_no_force_at_all_gives_no_ticks():
    assert len(_direct().simulate([], jitter=0.1)) == len(_direct().simulate([])) == 0


def test_specs_that_are_called_alike_have_rows_that_can_be_told_apart():
    tables = [{"controller": {"kind": "pmw", "b": b}, "bode": {"frequency_hz": [1.0]}} for b in (10.0, 20.0, 30.0)]
    found = wavesweep.bode(*tables)
    assert found["spec"].tolist() == ["spec", "spec 2", "spec 3"]
    assert list(found.attrs["facts"]["specs"]) == ["spec", "spec 2", "spec 3"]
    assert found["admittance_abs"][1] == wavesweep.bode(tables[1])["admittance_abs"][0]


def test_a_path_may_be_bytes(tmp_path):
    (tmp_path / "direct.toml").write_text('[controller]\nkind = "dc"\n')
    assert wavesweep.load(bytes(tmp_path / "direct.toml")).name == "direct"


def test_a_loop_in_a_notebook_shows_its_question_its_intervals_and_their_figure():
    shown = wavesweep.compile({"controller": {"kind": "dc-slow"}})._repr_html_()
    assert "For which K_VE from 0 to 20000" in shown
    assert "263.137165" in shown
    assert "<svg" in shown
    undecided = {"rates": {"tick_hz": 100.0}, "block": {"m": {"type": "mass", "mass": 1.0}}, "wire": {"m.f": "-m.x - m.v"}}
    assert wavesweep.compile(undecided)._repr_html_() is None  # no axis: the text alone
