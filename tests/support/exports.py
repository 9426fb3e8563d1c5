"""Exported controllers: random specs, and their C compiled and run."""

import csv
import re
import shutil
import subprocess

import numpy as np
import pytest

import wavesweep
from support.specs import nested, random_values
from wavesweep.simulation.experiment import radius_of
from wavesweep.simulation.export import exported

STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror")
COMPILERS = ("gcc", "clang")
LEVELS = ("-O0", "-O2")


def present():
    """The compilers that this machine has, if it also has make."""
    return [name for name in COMPILERS if shutil.which(name) and shutil.which("make")]


def random_tables(seed, ticks):
    """A loop of any kind, with filters up to order 12, made softer until it is stable; and an experiment with its hardware."""
    r = np.random.default_rng(seed)
    values = random_values(seed)
    values |= {f"filters.{name}.order": int(r.integers(0, 13)) for name in ("lp1", "hp", "lp2") if r.random() < 0.5}
    values["environment.delay"] = int(r.choice([0, 0, values["environment.delay"], r.integers(0, values["rates.ratio"] + 1)]))
    experiment = {"input": "noise", "amplitude": float(r.uniform(0.5, 5)), "duration_s": ticks / values["rates.fast_hz"]}
    choices = {
        "wall": float(r.normal(0, 0.01)), "resolution": 1e-5, "friction": 0.2, "jitter": 0.1, "max_force": 3.0,
        "late": int(r.integers(1, 3 * values["rates.ratio"] + 2)), "dropped": 0.1, "seed": int(r.integers(99)),
    }  # fmt: skip
    experiment |= {name: value for name, value in choices.items() if r.random() < 0.4}
    for _ in range(20):
        tables = nested(values) | {"simulate": experiment}
        if radius_of(wavesweep.load(tables)) < 1:
            break
        softer = ("environment.K_VE", "environment.B_VE", "local_model.K_LM", "local_model.B_LM", "controller.Kp")
        values |= {name: values[name] / 2 for name in softer}
    return tables


def written(tables, folder, **options):
    """The files of a spec's controller, written to a folder."""
    files = exported(wavesweep.load(tables), **options)
    put(files, folder)
    return files


def put(files, folder):
    """Write the files to a folder."""
    for name, text in files.items():
        (folder / name).write_text(text)


def made(folder, target, compiler, *flags):
    """What make says and prints, and its exit code; the program is compiled anew."""
    make = shutil.which("make")
    subprocess.run([make, "-s", "clean"], cwd=folder, check=True)
    words = [make, "-s", target, f"CC={compiler}", f"CFLAGS={' '.join((*flags, *STRICT))}"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def need(compiler):
    """Skip the test if the compiler is not there."""
    if compiler not in present():
        pytest.skip(f"no {compiler}")


def check(folder, compiler="gcc", *flags):
    """Compile what is in a folder, and hold every bit against its vectors; gives the number of their ticks."""
    code, said = made(folder, "check", compiler, *(flags or ("-O2",)))
    assert (code, said[-16:]) == (0, " no bit differs\n"), said
    return int(re.search(r"^(\d+) ticks, ", said, re.MULTILINE)[1])


def host_of(folder, *flags):
    """The columns that the host in example.c prints."""
    code, said = made(folder, "example", "gcc", *(flags or ("-O2",)))
    assert code == 0, said
    rows = list(csv.DictReader(said.splitlines()))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
