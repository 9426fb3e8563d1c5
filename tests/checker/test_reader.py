"""What the checker reads of a spec, against what the package reads of it, which shares nothing with it."""

import re
import tomllib
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from meaning import doubles
from meaning.judge import compiled, judge_radius
from meaning.machine import radius
from meaning.reading import drift_of, machine_of
from meaning.specs import linkage, spec_text

from wavesweep.checker.reader import loop_of

TOGETHER = 3  # specs of one test


def differing(texts, folder) -> list[str]:
    """The specs whose loops have other modes."""
    found = []
    for text in texts:
        tables = tomllib.loads(text)
        frame = machine_of(tables).monodromy()
        judged = judge_radius(tables, radius(frame, drift_of(tables, frame)), compiled(text, folder))
        found += [] if judged.same else [f"{judged.mine} and {judged.theirs} of {text}"]
    return found


@pytest.mark.parametrize("first", range(0, 40 * TOGETHER, TOGETHER))
def test_a_loop_has_the_radius_of_the_package(first, tmp_path):
    texts = [spec_text(number, quick=True) for number in range(first, first + TOGETHER)]
    assert differing(texts, tmp_path) == []


@pytest.mark.asks("axes")
@pytest.mark.parametrize("kind", ["five-bar", "pantograph", "delta"])
def test_a_device_of_several_axes_is_that_of_its_class(kind):
    """Motions of the hand by the energies of all parts, and by mass matrices of the joints as the package's class has them."""
    axes = pytest.importorskip("wavesweep.axes")
    drawing = tomllib.loads((Path(axes.__file__).parent / f"{kind}.toml").read_text())
    for seed in range(4):
        tables = linkage(seed, kind)
        made = deepcopy(tables) | {"type": {"made": drawing}}
        made["block"]["device"]["type"] = "made"
        (*_, A, B, _, _), (*_, of_class, of_forces, _, _) = (
            loop_of(each, doubles).plants[name] for each, name in ((tables, "device"), (made, "device.body"))
        )
        assert np.array(A) == pytest.approx(np.array(of_class), rel=1e-9, abs=1e-9)
        assert np.array(B) == pytest.approx(np.array(of_forces), rel=1e-9, abs=1e-9)


NUMBERS = "k = 40.0", "d = 0.5", "share = 0.7", "late_s = 0.0123"
MASSES = """
[block]
motor = { type = "mass", mass = 0.4, damping = 1.2, stiffness = 3 }
link = { type = "mass", mass = 0.2, damping = 0.6 }
"""
LATE = 'c = { type = "lowpass", a = 0.5 }\nlate = { type = "delay", seconds = %s }'
CLASSES = """
[type.arm]
numbers = { kp = { value = 30.0, unit = "N/m" }, half = "kp/2", d = 1.5 }
block.law = { type = "tf", num = ["half", "-kp/4"], den = [1, "1/kp"], discrete = true }
block.sum = { type = "integrator", method = "trapezoidal" }
block.part = { type = "mass_matrix", axes = ["x", "y"], mass = [["1/half", "0.01"], ["0.01", 0.3]], damping = [[1, "d"]] }
wire = { "law.u" = "place", "sum.u" = "-law.y", "part.fx" = "sum.y - law.y - kp*part.x", "part.fy" = "-9*part.y - kp*part.x" }
ports = { inputs = ["place"], outputs = { x = "part.x", y = "part.y + 0*sum.y" } }
"""
WRITTEN = {  # wires of two masses, which say what acts continuously and what is held; more blocks
    "a bracket": ("k*(link.x - motor.x) - d*motor.v", "-k*(link.x - motor.x) - d*link.v"),
    "a near end of another size": ("k*(link.x - share*motor.x)", "k*(motor.x - link.x)"),
    "a near end of another kind": ("k*(link.x - share*motor.v)", "-k*(link.x - motor.x)"),
    "two far ends in a bracket": ("k*(link.x + d*link.v - motor.x)", "-k*(link.x - motor.x) - 2*link.v"),
    "a block in a bracket": ("k*(link.x - motor.x + late.y) - 2*motor.x", "k*motor.x - k*link.x", LATE % "0", "-link.v"),
    "an end that stands apart": ("k*link.x - k*motor.x - share*k*motor.x", "k*motor.x - (k + d)*link.x - d*link.v"),
    "ends of place and of speed": ("k*link.x + k*link.v - k*motor.v - k*motor.x", "-k*link.x + k*motor.x"),
    "a far end twice": ("k*link.x + k*link.x - k*motor.x", "-k*link.x + k*motor.x"),
    "a near end twice": ("k*link.x - k*motor.x - k*motor.x", "-k*link.x - k*link.x + k*motor.x"),
    "a dead time of a plant": ("-late.y - k*motor.x", "k*motor.x - k*link.x", LATE % "0.0123", "d*motor.v"),
    "a dead time by its name": ("-late.y - k*motor.x", "-k*link.x", LATE % '"late_s"', "d*motor.v + share*motor.x"),
    "a dead time of a block": ("-late.y - k*motor.x", "-k*link.x", LATE % "0.0123", "2*c.y"),
    "a dead time of both": ("-late.y", "-k*link.x - late.y", LATE % "0.002", "c.y + 2*motor.x"),
    "a dead time of whole ticks": ("-late.y - k*motor.x", "-k*link.x", LATE % "0.015", "d*motor.v + share*c.y"),
}  # fmt: skip


def between(of_motor: str, of_link: str, blocks="", into="") -> str:
    """A spec, whose numbers are those that something reads."""
    wires = f'"motor.f" = "{of_motor}"\n"link.f" = "{of_link}"' + f'\n"late.u" = "{into}"\n"c.u" = "motor.x"' * bool(into)
    read = [number for number in NUMBERS if re.search(rf"\b{number.split()[0]}\b", wires + blocks)]
    return f"rates.tick_hz = 200\nnumbers = {{ {', '.join(read)} }}\n{MASSES}{blocks}\n[wire]\n{wires}\n"


@pytest.mark.parametrize("case", WRITTEN)
def test_a_loop_that_is_written_otherwise_has_the_radius_of_the_package(case, tmp_path):
    assert differing([between(*WRITTEN[case])], tmp_path) == []


def test_a_loop_of_classes_has_the_radius_of_the_package(tmp_path):
    arms = 'arm = { type = "arm", kp = 20, sum = { method = "explicit" } }\nother = { type = "arm" }'
    spec = (
        between("arm.y - k*motor.x", "other.x - k*link.x", arms) + '"arm.place" = "motor.x"\n"other.place" = "link.v"' + CLASSES
    )
    assert differing([spec], tmp_path) == []
