"""Each command that `check` suggests is one that the program does: none ends with exit code 2, as what is refused does."""

import contextlib
import io
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from meaning.specs import spec_text
from words.loops import drawn

from wavesweep.capabilities import modules
from wavesweep.check.on_check import _going_on
from wavesweep.check.planning import plan
from wavesweep.engine.errors import WavesweepError
from wavesweep.program.cli import main
from wavesweep.program.spec import load
from wavesweep.program.spec.writing import as_toml
from wavesweep.program.sweep import running
from wavesweep.program.tables.interval_table import stages_of

KINDS = ("dc", "dc-slow", "dc-lm", "dc-vc", "pmw", "pmw-lm")
FOR_ALL = (
    {"device.mass": [0.08, 0.125]},
    {"device.mass": {"start": 0.08, "stop": 0.125}},
    {"rates.ratio": [16, 20]},
    {"rates.ratio": {"values": [16, 20], "varying": True}},
    {"rates.ratio": {"values": [20, 40], "varying": True}, "contact": True},
    {"environment.delay": {"values": [1, 5], "varying": True}},
    {"lost": 1},
    {"loss": 0.1},
    {"contact": True},
    {"tick": {"late": 0.0002}},
)
REQUIRE = ({"damping_ratio": 0.3}, {"settling": 0.5}, {"radius": 0.99}, {"margins": {"cut": "wall.y", "phase_deg": 30}})
WALLS = {"start": 0, "stop": 2000}
SWEEPS = ({}, {"K_VE": WALLS}, {"K_VE": WALLS, "B_VE": [0.5, 1]}, {"B_VE": {"start": 0, "stop": 15}})


class ReachedError(BaseException):
    """Something is computed: what cannot be done has been refused before."""


def built_in(rng):
    """A controller by name with what may be asked of it."""
    tables = {"controller": {"kind": str(rng.choice(KINDS))}, "environment": {"delay": [0, 1, "frame"][rng.integers(3)]}}
    tables["environment"] |= {"integration": str(rng.choice(["implicit", "explicit"])), "K_VE": float(rng.choice([50, 500]))}
    sweep = dict(SWEEPS[rng.integers(len(SWEEPS))])
    if sweep and "K_VE" not in sweep:
        sweep["along"] = "B_VE"
    if rng.random() < 0.6:
        tables["for_all"] = FOR_ALL[rng.integers(len(FOR_ALL))]
    if rng.random() < 0.4:
        sweep["require"] = REQUIRE[rng.integers(len(REQUIRE))]
    return tables | ({"sweep": sweep} if sweep else {})


def with_a_channel(rng):
    """A mass on a spring over a channel, with numbers that may be 0 and that the loop takes from there on only."""
    channel = {"type": "channel", "every": int(rng.integers(1, 4))}
    channel |= ({}, {"late": 2}, {"late": 1, "lost": 1, "missing": "zero"}, {"loss": 0.1})[rng.integers(4)]
    tables = {
        "rates": {"tick_hz": 500},
        "numbers": {"k": float(rng.choice([0, 100])), "d": 2.0, "tau": float(rng.choice([0, 0.002])), "m": 0.3},
        "block": {"arm": {"type": "mass", "mass": "m", "damping": 1.0}, "net": channel, "lag": {"type": "tf"}},
        "wire": {"lag.u": "-k*arm.x - d*arm.v", "net.u": "lag.y", "arm.f": "net.y + push"},
        "ports": {"hand": {"force": "push", "displacement": "arm.x"}},
    }
    tables["block"]["lag"] |= {"num": [1], "den": [["tau", 0.01][rng.integers(2)], 1], "every": 1}
    ranges = {"m": [0.2, 0.4]}, {"m": {"start": 0.2, "stop": 0.4}}, {"d": {"start": 1, "stop": 3}}
    if rng.random() < 0.4:
        tables["for_all"] = ranges[rng.integers(3)]
    spans = {}, {"along": "k", "k": {"start": 0, "stop": 300}}, {"along": "tau", "tau": {"start": 0, "stop": 0.01}}
    sweep = spans[rng.integers(3)]
    if rng.random() < 0.3:
        sweep = sweep | {"require": {"damping_ratio": 0.2}}
    return tables | ({"sweep": sweep} if sweep else {})


def spec_of(seed):
    """A random spec as TOML, of four kinds in turn."""
    rng = np.random.default_rng(seed)
    if seed % 4 == 3:
        return spec_text(seed, quick=True)
    return as_toml((built_in(rng), with_a_channel(rng), drawn(seed).tables)[seed % 4])


def run(*command):
    """The exit code of a command, or 0 once it computes, what it wrote to stdout, and all that it wrote."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([*command])
        except ReachedError:
            code = 0
    return code, out.getvalue(), out.getvalue() + err.getvalue()


def suggested(text):
    """The commands under `next:`, and that of a range that takes longer."""
    found = re.findall(r"takes longer: wavesweep (.*(?:\n {6,}.*)*)", text)
    after = text.partition("\nnext")[2].splitlines()[1:]
    found += [line.strip().removeprefix("wavesweep ") for line in after if line.startswith("  wavesweep ")]
    return [shlex.split(re.split(r"\s{2,}", " ".join(map(str.strip, each.split("\n"))))[0]) for each in found]


def commands_of(text, monkeypatch):
    """Run all that `check` suggests for a spec up to where something is computed; gives these commands."""
    Path("mine.toml").write_text(text, encoding="utf-8")
    with monkeypatch.context() as patched:  # steps do not depend on proofs
        for module in modules("on_check"):
            if module.__name__.split(".")[1] in ("for_all", "contact", "late_ticks", "require"):
                patched.setattr(module, "facts", lambda *_: {})
                patched.setattr(module, "lines", lambda *_: [], raising=False)
        code, out, said = run("check", "mine.toml", "--all")
        assert code in (0, 2), said
        if code == 2:  # what is drawn at random may be refused, in one clear message
            return []
        _, as_json, said = run("check", "mine.toml", "--json")
        assert json.loads(as_json)["verdict"], said

    def reached(*_, **__):
        raise ReachedError

    commands = suggested(out)
    with monkeypatch.context() as patched:
        patched.setattr(running, "compute", reached)
        patched.setattr(running, "run", reached)
        for command in commands:
            table = ["--no-plot", "--overwrite"] if command[0] in ("zwidth", "stability-region", "why", "margins") else []
            place = [] if command[0] == "check" else ["--out", "t"]
            code, _, said = run(*command, *table, *place)
            assert code != 2, (command, said, text)
    return commands


HELD = {"controller": {"kind": "dc-slow"}, "environment": {"delay": "frame", "K_VE": 50.0}, "sweep": {"K_VE": WALLS}}
MISSED = {"rates.ratio": {"values": [20, 40], "varying": True}, "contact": True}
REQUIRED = {"for_all": {"device.mass": [0.08, 0.125]}, "sweep": {"K_VE": WALLS, "require": {"damping_ratio": 0.1}}}


@pytest.mark.asks("for_all", "require", "contact")
@pytest.mark.parametrize("more", [REQUIRED, {"for_all": MISSED}], ids=["a requirement", "contact beside missed frames"])
def test_a_table_of_rows_that_are_refused_is_not_possible(more):
    """[for_all] is about what its rows can be: `check` proves more, and does not send anybody to these."""
    spec = load(HELD | more)
    try:
        stages_of(spec, "K_VE", None)
    except WavesweepError:
        possible = False
    else:
        possible = True
    (said,) = [line for line in plan(spec, estimated=False) if line.startswith("  zwidth:")]
    assert ("not possible" in said) == (not possible)


def test_a_range_that_goes_on_ends_where_its_key_ends():
    """A time that may not be negative, searched from -10 on: the command is from 0 on, and not shown for what is whole."""
    dead = {"type": "delay", "seconds": "tau"}
    loop = {"arm": {"type": "mass", "mass": 0.3, "damping": 1.0}, "late": dead}
    wires = {"late.u": "-k*arm.x", "arm.f": "late.y"}
    spec = load({"rates": {"tick_hz": 500}, "numbers": {"k": 100.0, "tau": 0.0}, "block": loop, "wire": wires})
    limit = {"name": "tau", "from": 0.0, "to": 0.01, "low": None, "high": None, "stopped": True, "of_key": [True, False]}
    assert "{start=0, stop=" in _going_on(spec, limit)
    assert not _going_on(spec, limit | {"to": 10.0, "of_key": [True, True]})


@pytest.mark.slow
@pytest.mark.asks("for_all", "require", "contact")
@pytest.mark.parametrize("first", range(0, 200, 25))
def test_what_check_suggests_for_random_specs_is_done(first, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    found = [commands_of(spec_of(seed), monkeypatch) for seed in range(first, first + 4)]
    assert sum(map(len, found)) >= 5
