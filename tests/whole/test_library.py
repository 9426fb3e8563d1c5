"""The calls that do what the commands do."""

import re
from fractions import Fraction
from importlib import import_module
from inspect import isclass, isfunction
from pathlib import Path

import numpy as np
import pandas
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import wavesweep
from wavesweep.capabilities import CAPABILITIES
from wavesweep.engine.errors import UsageError
from wavesweep.program.platform_compat import one_thread

SPEC = {
    "controller": {"kind": "pmw"},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}, "B_VE": [0.5, 1.0], "b": [10.0, 25.0]},
    "bode": {"frequency_hz": [0.0, 1.0]},
    "simulate": {"duration_s": 0.5},
}
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


def test_the_spec_s_own_sweep_is_a_table_with_units_and_facts():
    table = wavesweep.zwidth(SPEC, jobs=1)
    assert list(table.columns[:2]) == ["B_VE", "b"]
    assert table.attrs["units"]["high"] == "N/m"
    assert table.attrs["units"]["B_VE"] == "N*s/m"
    assert table.attrs["facts"]["slices"]["computed"] == 4
    alone = wavesweep.compile(SPEC).stable_intervals(B_VE=[0.5, 1.0], b=[10.0, 25.0], span=(0, 2000))
    pandas.testing.assert_frame_equal(table, alone, check_like=True)
    assert alone.attrs["units"] == table.attrs["units"]


@pytest.mark.slow
def test_the_other_commands_have_a_call_each():
    assert set(wavesweep.bode(SPEC)["frequency_hz"]) == {0.0, 1.0}
    assert wavesweep.passivity(SPEC, jobs=1)["damping_needed"].isna().all()
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
    (lambda _: wavesweep.bode(), "at least one spec"),
    (lambda _: wavesweep.design(WISHED, checkpoint=5), "checkpoint: expected a file, found 5"),
    (lambda _: wavesweep.program.results.publish(None, ".", overwrite="no"), "overwrite: expected True or False, found 'no'"),
    (lambda _: wavesweep.program.results.read(None), "expected the path of a CSV or Parquet file, found None"),
    (lambda _: wavesweep.compile(3), "expected a path, or nested tables as a dict, found 3"),
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


def _direct():
    return wavesweep.compile({"controller": {"kind": "dc"}})


def test_calls_compute_with_one_thread_and_give_the_others_back(monkeypatch):
    """With several, small matrices take many times as long."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)

    def threads():
        return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        with one_thread():
            assert threads() == {1}
        assert threads() == {2}
