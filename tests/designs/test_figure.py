"""The figure of a study of designs says what its wishes are for."""

import numpy as np
import pytest

from wavesweep.program import plots
from wavesweep.program.spec import load

pytestmark = [pytest.mark.slow, pytest.mark.asks("for_all")]


def test_the_figure_names_walls_band_and_scenarios():
    """The walls of a wish, or those of the spec, and the numbers for which the worst counts."""
    study = {
        "vary": {"b": [5.0, 100.0]},
        "wish": {"z_width": {}, "transparency": {"band_hz": [0.1, 10.0], "walls": [100.0, 600.0], "B_VE": [2.0]}},
    }
    held = {"device.mass": [0.08, 0.125], "operator.damping": {"start": 0.0, "stop": 5.0}}
    spec = {"controller": {"kind": "pmw-lm"}, "environment": {"B_VE": 3.0}, "for_all": held, "design": study}
    spec = load(spec).asking("design").tables()
    columns = {"b": np.array([10.0, 20, 40, 80]), "z_width": np.array([1e3, 2e3, 3e3, 4e3])}
    columns["transparency"] = np.array([0.5, 0.6, 0.7, 0.9])
    own = {"own": {"z_width": None, "transparency": None}, "own_unstable": True}
    figure = plots.design(columns, {"spec": spec, "assumes": "no delay", **own})
    damping, stiffness = "$B_\\mathrm{VE}$", "$K_\\mathrm{VE}$"
    said = " ".join(figure.get_supxlabel().split())
    assert (
        f"Stiffest wall with {damping} = 3 N·s/m; error of the response with {stiffness} = 100, 600 N/m, {damping} = 2" in said
    )
    assert "0.1 to 10 Hz. Worst for device mass = 0.08, 0.125 kg; operator damping from 0 to 5 N·s/m." in said
    assert figure.axes[1].get_xlabel() == "stiffest wall (N/m)"


@pytest.mark.asks("margins")
def test_wishes_of_one_kind_are_told_apart_by_their_cuts():
    loop = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 3.0},
        "block": {"axis": {"type": "mass", "mass": 0.1, "damping": 0.5}, "h": {"type": "hold"}},
        "wire": {"h.u": "-K*axis.v", "axis.f": "h.y"},
        "design": {"vary": {"K": [1.0, 5.0]}, "wish": {"disk": [{"cut": "h.y"}, {"cut": "axis.v"}]}},
    }
    spec = load(loop).asking("design").tables()
    columns = {"K": np.array([1.0, 2.0]), "disk": np.array([0.5, 0.6]), "disk_2": np.array([0.4, 0.3])}
    figure = plots.design(columns, {"spec": spec, "assumes": "no delay", "own": {}})
    titles = [axes.get_title().partition(",")[0] for axes in figure.axes]
    assert titles == ["disk margin at h.y", "disk margin at axis.v", "K"]
