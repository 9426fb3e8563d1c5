"""The controller in C is that of the simulation to the last bit, for every controller, compiler and level of optimisation.

WAVESWEEP_EXPORTS=200 runs so many random specs over 100,000 ticks each.
"""

import csv
import os
import re
import shutil
import subprocess
from functools import lru_cache

import numpy as np
import pytest
from support.exports import COMPILERS, LEVELS, check, host_of, made, need, put, random_tables, written
from support.specs import KINDS, nested, values_of

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.simulation.export import exported
from wavesweep.simulation.from_spec import simulated
from wavesweep.simulation.hardware import Effects
from wavesweep.simulation.march import simulate

MANY = int(os.environ.get("WAVESWEEP_EXPORTS", "0"))
SEEDS, TICKS = (range(MANY), 100_000) if MANY else (range(8), 2000)
CHANGES = (
    {"delay": 3, "velocity": "difference", "lp1_order": 3},
    {"Kp": 20.0, "integration": "trapezoidal", "lp1_order": 0, "local_model__delay": 0, "hp_order": 2},
)
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not shutil.which("make"), reason="no make"),
]
compilers = pytest.mark.parametrize("compiler", COMPILERS)


@lru_cache(maxsize=1)
def random_files(seed):
    """The files of a random spec, computed once for all compilers."""
    return exported(wavesweep.load(random_tables(seed, TICKS)))


def experiment(kind, simulate=None, **changes):
    """The tables of the paper's loop, softer, under noise."""
    loop = {"K_VE": 100.0, "local_model__K_LM": 80.0, **changes}
    return nested(values_of(kind, **loop)) | {"simulate": {"input": "noise", "duration_s": 1.5, **(simulate or {})}}


@pytest.mark.sample(2)
@compilers
@pytest.mark.parametrize("seed", SEEDS)
def test_no_bit_of_a_random_controller_differs(seed, compiler, tmp_path):
    need(compiler)
    files = random_files(seed)
    put(files, tmp_path)
    ticks = files["vectors.csv"].count("\n") - 1
    assert [check(tmp_path, compiler, level) for level in LEVELS] == [ticks, ticks]


@pytest.mark.sample(2)
@compilers
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", CHANGES)
def test_no_bit_of_each_kind_differs_behind_a_surface_with_late_and_lost_results(kind, changes, compiler, tmp_path):
    need(compiler)
    effects = {"wall": 0.0, "late": 45, "dropped": 0.1, "amplitude": 5.0, "seed": 0}
    tables = experiment(kind, effects, **changes)
    files = written(tables, tmp_path)
    rows = list(csv.DictReader(files["vectors.csv"].splitlines()))
    seen = simulated(wavesweep.load(tables)).signals
    assert set(seen["touching"].tolist()) == {True, False}
    assert {"-1", "0"} < {row["late_0"] for row in rows}
    assert [float.fromhex(row["ws_device_f"]) for row in rows] == (-seen["f_m"]).tolist()
    check(tmp_path, compiler)


def test_the_check_sees_one_bit(tmp_path):
    need("gcc")
    files = written(experiment("pmw", delay=3), tmp_path)
    lines = files["vectors.csv"].splitlines()
    names, row = lines[0].split(","), lines[100].split(",")
    place = names.index("ws_device_f")
    row[place] = float(np.nextafter(float.fromhex(row[place]), np.inf)).hex()
    (tmp_path / "vectors.csv").write_text("\n".join([*lines[:100], ",".join(row), *lines[101:], ""]))
    code, said = made(tmp_path, "check", "gcc", "-O1")
    assert code == 2  # of make
    assert re.search(r"^\d+ ticks, 1 signals each: \d+ numbers differ$", said, re.MULTILINE)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("kind", "changes"), [(kind, changes) for kind in KINDS for changes in CHANGES])
def test_the_host_closes_the_loop_as_the_simulation_does(kind, changes, tmp_path):
    need("gcc")
    tables = experiment(kind, **changes)
    written(tables, tmp_path)
    found = host_of(tmp_path)
    seen = simulate(wavesweep.load(tables).values, np.ones(2000), Effects()).signals
    for name, column in (("ws_device_x", seen["x"]), ("ws_device_v", seen["v"]), ("ws_device_f", -seen["f_m"])):
        assert name not in found or np.array_equal(found[name], column)


@pytest.mark.sample(4)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("changes", CHANGES)
def test_floats_are_within_the_rounding_of_each_tick_and_a_wrong_coefficient_is_not(kind, changes, tmp_path):
    need("gcc")
    files = written(experiment(kind, {"duration_s": 0.3}, **changes), tmp_path, floats=True)
    assert made(tmp_path, "example", "gcc", "-O2")[0] == 0
    code, said = made(tmp_path, "check", "gcc", "-O2")
    share = re.search(
        r"^300 ticks, 1 signals each: no bit of the doubles differs; floats .*, at most (\S+) of one$", said, re.MULTILINE
    )
    assert code == 0
    assert 1e-4 < float(share[1]) < 1
    text = files["controller.c"]
    wrong = re.search(r"0x1\.[\da-f]+p[+-]\d+f \* z|(?<=else \{\n        s->z\[ws_z_wall_force\] = \()K \* gap", text)
    (tmp_path / "controller.c").write_text(f"{text[: wrong.start()]}1.001f * {text[wrong.start() :]}")
    assert made(tmp_path, "check", "gcc", "-O2")[0] == 2


def test_a_run_that_decays_below_the_normal_floats_is_within_their_rounding(tmp_path):
    """From 1e-38 on a rounding is no share of what is rounded, and the gains make it larger."""
    need("gcc")
    tables = {
        "rates": {"tick_hz": 1000},
        "block": {"dev": {"type": "mass", "mass": 0.1, "damping": 50, "stiffness": 10000}, "h": {"type": "hold"}},
        "wire": {"h.u": "1000*dev.x + 5*dev.v", "dev.f": "w - h.y"},
        "ports": {"inputs": {"w": "w"}, "outputs": {"x": "dev.x"}},
        "simulate": {"input": "pulse", "duration_s": 0.6, "at_s": 0.01, "width_s": 0.03},
    }
    written(tables, tmp_path, floats=True)
    code, said = made(tmp_path, "check", "gcc", "-O2")
    assert code == 0, said


@pytest.mark.parametrize("effects", [{"wall": 0.0}, {"late": 5}])
def test_what_a_float_may_decide_otherwise_is_refused(effects, tmp_path):
    with pytest.raises(UsageError, match="--float is for a linear loop"):
        written(experiment("pmw", effects), tmp_path, floats=True)


def test_the_controller_needs_no_library(tmp_path):
    """But what a compiler writes for a loop that clears or moves memory, which it asks of every system."""
    need("gcc")
    for kind in KINDS:
        written(experiment(kind, local_model__delay=0, lp1_order=12), tmp_path)
        subprocess.run([shutil.which("gcc"), "-std=c99", "-O2", "-c", "controller.c"], cwd=tmp_path, check=True)
        found = subprocess.run(
            [shutil.which("nm"), "-u", "controller.o"], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        assert set(found.stdout.split()) - {"U", "memset", "memcpy", "memmove"} == set()


@pytest.mark.parametrize("flags", [["-ffast-math"], ["-mfma"], ["-mavx512f", "-mno-fma"], ["-m32", "-mfpmath=387"]])
def test_a_build_with_other_arithmetic_is_refused(flags, tmp_path):
    need("gcc")
    if not flags[0].startswith("-ff") and "x86_64" not in os.uname().machine:
        pytest.skip("flags of another processor")
    written(experiment("pmw"), tmp_path)
    words = [shutil.which("gcc"), "-std=c99", "-fsyntax-only", "-ffreestanding", *flags, "controller.c"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "compile controller.c with" in done.stderr


@compilers
@pytest.mark.parametrize("kind", ["dc-lm", "pmw-lm"])
def test_no_bit_differs_of_a_wall_that_only_pushes(kind, compiler, tmp_path):
    need(compiler)
    effects = {"wall": 0.0, "pulls": False, "late": 45, "amplitude": 5.0}
    written(experiment(kind, effects), tmp_path)
    check(tmp_path, compiler, "-O2")


@pytest.mark.parametrize(("stiffness", "fault"), [(1.0, 0), (5e4, 1)])
def test_a_one_sided_wall_that_is_both_met_and_not_is_told_to_the_host(tmp_path, stiffness, fault):
    need("gcc")
    filters = {f"{name}_order": 0 for name in ("lp1", "lp2")}
    loop = {"b": 4.0, "K_VE": 1.0, "B_VE": 0.0, "local_model__K_LM": 1e4, "local_model__delay": 0, **filters}
    written(experiment("pmw-lm", {"wall": 0.0}, **loop), tmp_path)
    program = (
        '#include <stdio.h>\n#include "controller.h"\nint main(void) { ws_state s; ws_inputs in = {0.1}; ws_init(&s);\n'
        f's.touching = 1; s.wall.K = {stiffness}; ws_fast_tick(&s, in); printf("%d\\n", s.ill_posed); return 0; }}\n'
    )
    (tmp_path / "example.c").write_text(program)
    assert made(tmp_path, "example", "gcc", "-O2") == (0, f"{fault}\n")


def test_the_header_is_one_of_cpp_too(tmp_path):
    if not shutil.which("g++"):
        pytest.skip("no g++")
    written(experiment("pmw"), tmp_path)
    (tmp_path / "host.cpp").write_text('#include "controller.h"\nint main() { ws_state s; ws_init(&s); }\n')
    for words in (["gcc", "-std=c99", "-c", "controller.c"], ["g++", "host.cpp", "controller.o", "-o", "host"], ["./host"]):
        subprocess.run(words, cwd=tmp_path, check=True)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("slow_hz", "delay"), [(60.0, 5), (60.0, "frame"), (480.0, 3)])
@pytest.mark.parametrize("kind", KINDS)
def test_rates_that_do_not_divide_are_exported_too(kind, slow_hz, delay, tmp_path):
    need("gcc")
    effects = {"input": "noise", "duration_s": 0.5, "wall": 0.001, "late": 20, "dropped": 0.1, "amplitude": 5.0}
    loop = {"controller": {"kind": kind}, "rates": {"slow_hz": slow_hz}, "environment": {"K_VE": 100.0, "delay": delay}}
    written(loop | {"simulate": effects}, tmp_path)
    check(tmp_path)
