"""The calls that do what the commands do."""

import re
import sys
import tomllib
from fractions import Fraction
from importlib import import_module
from inspect import isclass, isfunction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import wavesweep
from wavesweep.capabilities import CAPABILITIES, of_library
from wavesweep.engine import StateSpaceBlock, loop_from_blocks
from wavesweep.engine._loops import blocks
from wavesweep.engine._loops.multirate import MultirateLoop, ScheduledBlock
from wavesweep.engine.errors import UsageError
from wavesweep.program import api
from wavesweep.program.platform_compat import one_thread
from wavesweep.program.spec import load
from wavesweep.program.sweep.progress_bar import reporting
from wavesweep.program.tables import fields as tables_fields
from wavesweep.program.tables import interval_table, kind_named
from wavesweep.program.tables.fields import COLUMNS, Field
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.response_table import responses

SPEC = {
    "controller": {"kind": "pmw"},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}, "B_VE": [0.5, 1.0], "b": [10.0, 25.0]},
    "bode": {"frequency_hz": [0.0, 1.0]},
    "simulate": {"duration_s": 0.5},
}
WHEEL = Path(__file__).parents[2] / "sweeps" / "recipes" / "wheel.toml"
VARIED = {"b": {"start": 5.0, "stop": 80.0}}
WISHED = {
    "controller": {"kind": "pmw"},
    "design": {"vary": VARIED, "wish": {"z_width": {}}, "population": 8, "generations": 1},
}


def test_what_capabilities_have_for_the_library_is_in_their_lines_and_in_the_stub():
    for each in CAPABILITIES:
        if each.library:
            home = import_module(f"wavesweep.{each.name}.library")
            own = [value for value in vars(home).values() if getattr(value, "__module__", "") == home.__name__]
            classes = {kind.__name__.removesuffix(each.class_for("")): kind for kind in own if isclass(kind)}
            methods = {f"{name}.{method}" for name, kind in classes.items() for method in vars(kind) if method[0] != "_"}
            assert {value.__name__ for value in own if isfunction(value) and value.__name__[0] != "_"} | methods == set(
                each.library
            )
    stub = Path(wavesweep.__file__).with_suffix(".pyi").read_text("utf-8")
    assert {name for name in wavesweep.__all__ if not re.search(rf"\b{name}\b", stub)} == set()


def test_a_name_of_a_capability_that_is_not_there_says_where_the_names_are(monkeypatch):
    loop, some = wavesweep.compile(SPEC), [each for each in CAPABILITIES if each.name == "check"]
    monkeypatch.setattr(wavesweep.capabilities, "CAPABILITIES", some)
    assert "why" not in dir(wavesweep)
    assert "sensitivity" not in dir(loop)
    for call in (lambda: wavesweep.why, lambda: loop.sensitivity):
        with pytest.raises(AttributeError, match=r"has no .*; (dir\((wavesweep|loop)\) lists what there is|did you mean .*)$"):
            call()


@pytest.mark.parametrize(
    ("slip", "hint"),
    [
        ("margin", "did you mean margins?"),
        ("stable_interval", "did you mean stable_intervals?"),
        ("plot_zwith", "did you mean plot_zwidth?"),
        ("lifted", "dir(loop) lists what there is"),
    ],
)
def test_a_slip_in_a_name_of_a_loop_is_answered_with_the_nearest_one(slip, hint):
    with pytest.raises(AttributeError) as raised:
        getattr(wavesweep.compile(SPEC), slip)
    assert str(raised.value) == f"wavesweep has no Loop.{slip}; {hint}"


def test_a_slip_in_a_name_of_the_library_is_answered_with_the_nearest_one():
    for slip, meant in (("zwdith", "zwidth"), ("Lop", "Loop"), ("verdct", "verdict")):
        with pytest.raises(AttributeError, match=rf"^wavesweep has no {slip}; did you mean {meant}\?$"):
            getattr(wavesweep, slip)


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


@pytest.mark.thorough
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


@pytest.mark.slow
def test_hands_are_an_option():
    table = wavesweep.zwidth(
        {"controller": {"kind": "dc"}, "device": {"velocity": "difference"}, "sweep": {**SPEC["sweep"], "B_VE": [1.0]}},
        for_hands="passive",
        jobs=1,
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


REFUSED = [
    (lambda spec: wavesweep.zwidth(spec, jobs=0), "jobs: expected a whole number >= 1, found 0"),
    (lambda spec: wavesweep.zwidth(spec, jobs=True), "found True"),
    (lambda spec: wavesweep.zwidth(spec, workers=2), "expected one of the arguments jobs, backend, scheduler,"),
    (lambda spec: wavesweep.zwidth(spec, scheduler="tcp://there:8786"), "backend"),
    (lambda spec: wavesweep.zwidth(spec, for_hands="nope"), "expected one of box, passive, port, found 'nope'"),
    (lambda spec: wavesweep.zwidth(spec, for_hands="box:x=0..1"), "(mass, damping, stiffness), found 'x=0..1'"),
    (lambda spec: wavesweep.zwidth(spec, for_hands="box:mass=nan..1"), "found"),
    (lambda spec: wavesweep.zwidth(spec, force="no"), "force: expected True or False, found 'no'"),
    (lambda spec: wavesweep.zwidth(spec, along=3.0), "found 3.0"),
    (lambda spec: wavesweep.zwidth(spec, checkpoint=3), "checkpoint: expected a file, found 3"),
    (lambda spec: wavesweep.passivity(spec, tolerance="x"), "tolerance"),
    (lambda spec: wavesweep.filter_choices(spec, tolerance=-1.0), "tolerance"),
    (lambda _: wavesweep.bode(), "at least one spec"),
    (lambda _: wavesweep.design(WISHED, for_hands="nope"), "for_hands: expected one of vertices, box, found 'nope'"),
    (lambda _: wavesweep.design(WISHED, checkpoint=5), "checkpoint: expected a file, found 5"),
    (lambda _: wavesweep.program.results.publish(None, ".", overwrite="no"), "overwrite: expected True or False, found 'no'"),
    (lambda _: wavesweep.program.results.read(None), "expected the path of a CSV or Parquet file, found None"),
    (lambda _: wavesweep.compile(3), "expected a path, or nested tables as a dict, found 3"),
    (lambda _: wavesweep.compile(MultirateLoop(1e-3, (), {})), "a drawn loop: expected at least one block, found none"),
    (lambda _: _publish(partition=2.5), "partition: expected a whole number of rows >= 1, found 2.5"),
    (lambda _: _direct().stable_intervals(["K_VE"]), "K_VE"),
    (lambda _: _direct().stable_intervals(span=(0, 10**400)), "span"),
    (lambda _: _direct().stable_intervals(span=(False, True)), "span"),
    (lambda _: _direct().stable_intervals(span="09"), "span"),
    (lambda _: _direct().stable_intervals(B_VE=[[1.0, 2.0], [3.0, 4.0]]), "B_VE"),
    (lambda _: _direct().spectral_radius(B_VE=["1"]), "B_VE"),
    (lambda _: _direct().response([1.0, True]), "frequency_hz"),
    (lambda _: _direct().response(1j), "frequency_hz"),
    (lambda _: _direct().response([1.0, -2.0]), "frequency_hz: expected finite numbers >= 0, found -2.0"),
    (lambda _: _direct().simulate(["1", "2"]), "force"),
    (lambda _: _direct().simulate(np.ones(3), wall="0.1"), "wall"),
    (lambda _: _direct().simulate([0.0] * 10, resolution=None), "option resolution: expected a number >= 0, found None"),
    (lambda _: _direct().simulate([0.0] * 10, seed=1.5), "option seed: expected a whole number >= 0, found 1.5"),
]


@pytest.mark.parametrize(("call", "says"), REFUSED)
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
    for name in ("zwidth.csv", "zwidth.parquet"):
        with pytest.raises(UsageError, match="expected a whole table"):
            wavesweep.program.results.read(tmp_path / name)


def test_the_functions_of_results_can_be_imported_from_their_module():
    from wavesweep.results import read, read_table, verify

    assert (read, read_table, verify) == tuple(getattr(wavesweep.results, name) for name in ("read", "read_table", "verify"))
    with pytest.raises(ImportError, match="cannot import name 'nothing'"):
        from wavesweep.results import nothing  # noqa: F401


def _direct():
    return wavesweep.compile({"controller": {"kind": "dc"}})


def _publish(**options):
    wavesweep.program.results.publish(responses([load({"controller": {"kind": "dc"}})]), "nowhere", **options)


def test_specs_that_are_called_alike_have_rows_that_can_be_told_apart():
    tables = [{"controller": {"kind": "pmw", "b": b}, "bode": {"frequency_hz": [1.0]}} for b in (10.0, 20.0, 30.0)]
    found = wavesweep.bode(*tables)
    assert found["spec"].tolist() == ["spec", "spec 2", "spec 3"]
    assert list(found.attrs["facts"]["specs"]) == ["spec", "spec 2", "spec 3"]
    assert found["admittance_abs"][1] == wavesweep.bode(tables[1])["admittance_abs"][0]


def test_a_loop_in_a_notebook_shows_its_question_its_intervals_and_their_figure():
    shown = wavesweep.compile({"controller": {"kind": "dc-slow"}})._repr_html_()
    assert "<th>low</th>" in shown
    assert "<th>doubt</th>" not in shown  # which is empty
    assert "For which K_VE from 0 to 20000" in shown
    assert "263.137165" in shown
    assert "<svg" in shown
    undecided = {"rates": {"tick_hz": 100.0}, "block": {"m": {"type": "mass", "mass": 1.0}}, "wire": {"m.f": "-m.x - m.v"}}
    assert wavesweep.compile(undecided)._repr_html_() is None  # no axis: the text alone


def test_calls_compute_with_one_thread_and_give_the_others_back(monkeypatch):
    """With several, small matrices take many times as long."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)

    def threads():
        return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        with one_thread():
            assert threads() == {1}
        assert threads() == {2}


def test_a_derived_column_needs_only_its_field(monkeypatch):
    """The same column comes with a command's table and with the library's."""
    width = Field("width", "number", "N/m", "high - low", derived=lambda columns: columns["high"] - columns["low"])
    monkeypatch.setattr(tables_fields, "COLUMNS", {**COLUMNS, "zwidth": (*COLUMNS["zwidth"], width)})
    spec = {"controller": {"kind": "dc"}, "sweep": {"K_VE": {"start": 0, "stop": 9000}, "B_VE": [1.0, 2.0]}}
    rows = wavesweep.compile(load(spec)).stable_intervals("K_VE", B_VE=[1.0, 2.0])
    assert rows["width"].tolist() == (rows["high"] - rows["low"]).tolist()
    assert intervals(load(spec)).columns["width"].tolist() == rows["width"].tolist()


@pytest.mark.parametrize(
    ("call", "kind"),
    [
        (api.Loop.stable_intervals, "zwidth"),
        (api.Loop.response, "bode"),
        (of_library("Loop.margins"), "margins"),
        (of_library("Loop.passivity"), "passivity"),
        (of_library("filter_choices"), "passivity-filters"),
        (of_library("Loop.sensitivity"), "why"),
    ],
)
def test_the_help_of_a_call_names_its_columns_with_their_units(call, kind):
    for column in (each for each in kind_named(kind).fields if not each.optional):
        assert re.search(rf"\b{column.name}\b", call.__doc__), column.name
    assert any(unit in call.__doc__ for unit in ("rad/s", "Hz", "m/N"))


def test_loops_are_told_in_a_line():
    plant = StateSpaceBlock(A=[[0, 1], [0, -10]], B=[[0], [10]], C=[[1, 0]])
    loop = loop_from_blocks({"plant": plant}, {"plant.u": "-kp*plant.y"}, rate_hz=1000, numbers={"kp": 1.0})
    assert repr(loop) == "<ClosedLoop: plant; frame of 1 ms; kp = 1>"
    block = blocks.ss("g", 1.0, [[0.5]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",), discrete=True)
    drawn = wavesweep.compile(MultirateLoop(0.001, (ScheduledBlock(block, 2, 0),), {"g.u": {"g.y": -0.5}}))
    assert repr(drawn) == "<DrawnLoop: g; frame of 2 ticks>"
    assert repr(wavesweep.load({"controller": {"kind": "pmw"}})) == "<Spec spec: pmw, from tables>"


def test_what_was_computed_is_kept_for_the_next_question(monkeypatch):
    monkeypatch.setattr(api, "MOST_ANSWERS", 16)  # benchmarks keep none
    loop = wavesweep.compile({"controller": {"kind": "dc-slow"}})
    first = loop.stable_intervals(B_VE=[1.0, 2.0])
    first.loc[:, "low"] = -1.0  # what a caller does to a table is his own
    monkeypatch.setattr(interval_table, "of_calls", None)
    assert loop.stable_intervals(B_VE=np.array([1.0, 2.0]))["low"].tolist() == [0.0, 0.0]
    with pytest.raises(TypeError):
        loop.stable_intervals(B_VE=[1.0, 3.0])


@pytest.mark.parametrize("installed", [False, True])
def test_a_bar_shows_what_is_done(monkeypatch, installed):
    moved, said = [], []

    class Bar:
        def __init__(self, **_):
            self.n = 0

        def __enter__(self):
            return self

        def __exit__(self, *_):
            moved.append("closed")

        def set_postfix_str(self, text, **_):
            said.append(text)

        def update(self, more):
            self.n += more
            moved.append((self.n, self.total))

    auto = SimpleNamespace(tqdm=Bar) if installed else None
    monkeypatch.setitem(sys.modules, "tqdm", auto and SimpleNamespace(auto=auto))
    monkeypatch.setitem(sys.modules, "tqdm.auto", auto)
    table = wavesweep.zwidth({"controller": {"kind": "dc-slow"}, "sweep": {"B_VE": [1, 2]}}, progress=True)
    assert len(table) == 2
    assert moved == ([(0, 2), (2, 2), "closed"] if installed else [])
    assert said == (["0 certified", "2 certified"] if installed else [])
    with reporting(True) as report:
        report(1, 4, None)
        report(3, 4, None)
    assert moved[3:] == ([(1, 4), (3, 4), "closed"] if installed else [])
