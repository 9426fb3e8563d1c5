"""Processor seconds of proofs over sets, and of designs for them: `OPENBLAS_NUM_THREADS=1 python benchmarks/sets_speed.py`.

    python benchmarks/sets_speed.py [--beside CHECKOUT] [--only WORD ...]

Every case is a command in a process of its own, with all that it starts. --beside: each runs in another checkout of the package
as well, such as an older version, right after this one; the ratio of both is printed, and whether they wrote the same table.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
FIG4 = "sweeps/paper/fig4.toml"
ONE_ROW = ("sweep.B_VE=[1]", "controller.b=10", "filters.lp1={ order = 1, cutoff_hz = 8.57 }")
MASS = '"device.mass" = { start = 0.08, stop = 0.125 }'
HAND = '"operator.stiffness" = { start = 0, stop = 1000 }'
FRAMES = '"rates.ratio" = { values = [16, 20, 25, 33], varying = true }'
RIDGE = """
[rates]
tick_hz = 1000
[numbers]
p = 0.5
q = 0.5
[block.x]
type = "delay"
[block.y]
type = "gain"
k = 1
[wire]
"x.u" = "(0.5 + 0.49*exp(-((p - q - 0.137)/0.01)**2))*x.y"
"y.u" = "x.y"
[for_all]
p = { start = 0, stop = 1 }
q = { start = 0, stop = 1 }
"""
SLOW_BOX = """
[rates]
fast_hz = 200
ratio = 4
[device]
mass = 0.3
damping = 2
[environment]
integration = "explicit"
delay = 1
B_VE = 1
[controller]
kind = "pmw"
b = 8
[filters.lp1]
order = 1
cutoff_hz = 20
[for_all]
"filters.lp1.cutoff_hz" = { start = 2, stop = 99.99 }
"device.mass" = { start = 0.05, stop = 0.4 }
[sweep]
K_VE = { start = 0, stop = 3000 }
B_VE = [1]
"""
MEASURED = """
[rates]
fast_hz = 1000
ratio = 11
[device]
mass = 0.115
damping = 0.85
dead_time = 0.0014
velocity = "difference"
[environment]
integration = "explicit"
delay = "frame"
K_VE = 200
B_VE = 1
[controller]
kind = "pmw"
b = 10
[filters.lp1]
order = 1
cutoff_hz = 10
[for_all]
"rates.ratio" = { values = [9, 10, 11, 12, 13, 14, 15], varying = true }
"device.mass" = { start = 0.114997, stop = 0.115002 }
"device.damping" = { start = 0.84994, stop = 0.85005 }
"device.dead_time" = { start = 0.0013995, stop = 0.0014008 }
[sweep]
K_VE = { start = 0, stop = 2000 }
B_VE = [1]
"""
DESIGN = """
[design]
population = 8
generations = 5
[design.vary]
b = { start = 5, stop = 40, scale = "log" }
[design.wish]
z_width = {}
"""
SPRING = """
[rates]
tick_hz = 100
[numbers]
K = 40.0
m = 0.2
c = 2.0
k = 100.0
[block.mass]
type = "mass"
mass = "m"
damping = "c"
[block.h]
type = "hold"
every = 2
[wire]
"h.u" = "mass.x"
"mass.f" = "-k*mass.x - K*h.y"
[for_all]
k = { start = 90, stop = 110 }
m = { start = 0.18, stop = 0.22 }
"""
SERVO = """
[rates]
tick_hz = 16000
[numbers]
L = 2.0e-3
Jl = 3e-4
kp = 0.12
kv = 30.0
[block.coil]
type = "tf"
num = [1]
den = ["L", 0.8]
[block.ctrl]
type = "pi"
kp = "2*pi*800*L"
ki = "2*pi*800*0.8"
[block.pwm]
type = "delay"
seconds = "1.5/16000"
[block.motor]
type = "inertia"
inertia = 1.2e-4
damping = 2e-4
[block.load]
type = "inertia"
inertia = "Jl"
damping = 2e-4
[block.shaft]
type = "spring"
k = 300.0
d = 0.01
[block.encoder]
type = "difference"
every = 8
[block.speed]
type = "pi"
kp = "kp"
ki = 5.0
every = 8
[block.position]
type = "gain"
k = "kv"
every = 32
[block.bus]
type = "channel"
every = 32
late = 16
[wire]
"ctrl.u" = "speed.y - coil.y"
"pwm.u" = "ctrl.y"
"coil.u" = "pwm.y"
"motor.f" = "0.5*coil.y + shaft.f1"
"load.f" = "shaft.f2"
"shaft.x1" = "motor.x"
"shaft.v1" = "motor.v"
"shaft.x2" = "load.x"
"shaft.v2" = "load.v"
"encoder.u" = "motor.x"
"position.u" = "-motor.x"
"bus.u" = "position.y"
"speed.u" = "bus.y - encoder.y"
[for_all]
L = { start = 1.8e-3, stop = 2.2e-3 }
[sweep]
along = "kp"
kp = { start = 0, stop = 2 }
Jl = [1e-4, 3e-4, 1e-3]
kv = [10, 30, 100]
"""
CASES = {  # a title: a command, its spec, as a path or a text, and changes of that
    "mass and hand": ("zwidth", FIG4, *ONE_ROW, f"for_all={{ {MASS}, {HAND} }}"),
    "hand box": ("zwidth", FIG4, *ONE_ROW, "--for-hands", "box"),
    "mass and frames": ("zwidth", FIG4, *ONE_ROW, f"for_all={{ {FRAMES}, {MASS} }}"),
    "two axes": (
        "zwidth",
        "sweeps/recipes/two-axes.toml",
        *("sweep.q2=", "sweep.phi=", "sweep.kh=[400]"),
        "for_all={ phi = { start = 0, stop = 3.1416 }, q2 = { start = 0.4, stop = 1.4 } }",
    ),
    "quadrotor": ("stability-region", "sweeps/recipes/quadrotor.toml"),
    "a box that is slow": ("zwidth", SLOW_BOX),
    "a narrow ridge": ("check", RIDGE),
    "margins, two ranges": ("margins", SPRING, "--cut", "h.y"),
    "margins, three ranges": ("margins", SPRING, "--cut", "h.y", "for_all.c={ start = 1.8, stop = 2.2 }"),
    "late messages": ("stability-region", SERVO, "for_all="),
    "late messages and a range": ("stability-region", SERVO),
    "measured device": ("zwidth", MEASURED),
    "design of a measured device": ("design", MEASURED + DESIGN),
    "design of a device": ("design", "sweeps/design/plain.toml", f"for_all={{ {MASS} }}"),
}


def cost(checkout: Path, case: tuple[str, ...], out: Path) -> tuple[float, bytes]:
    """Processor seconds of a case in a checkout, and the tables that it wrote, or what it said."""
    command, spec, *changes = case
    path = checkout / spec
    if "\n" in spec:
        path = out / "spec.toml"
        path.write_text(spec)
    words = [command, str(path)]
    words += [word for each in changes for word in (("--set", each) if "=" in each else (each,))]
    if command != "check":
        words += ["--no-plot", "--out", str(out / "table")]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-m", "wavesweep", *words],
        env=os.environ | {"PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"},
        cwd=checkout,
        capture_output=True,
        check=False,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{words}: {done.stderr.decode()}")
    tables = sorted(out.glob("table/**/*.csv"))
    written = b"".join(each.read_bytes() for each in tables) or done.stdout
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, written


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--beside", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    given = parser.parse_args()
    for title, case in CASES.items():
        if given.only and not any(word in title for word in given.only):
            continue
        results = []
        for checkout in filter(None, (HERE, given.beside)):
            with tempfile.TemporaryDirectory() as out:
                results.append(cost(checkout, case, Path(out)))
        (now, table), *other = results
        words = f"{title:28} {now:7.2f} s"
        for before, others in other:
            same = "the same table" if others == table else "another table"
            words += f", beside {before:.2f} s, {before / now:.2f} times; {same}"
        print(words, flush=True)


if __name__ == "__main__":
    main()
