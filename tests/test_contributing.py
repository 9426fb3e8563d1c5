"""CONTRIBUTING walks a maintainer through a new controller and a new analysis; these tests walk it, code and all."""

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm
from support.documents import ROOT, code
from support.specs import values_of

from wavesweep import plots
from wavesweep.cli.entry import COMMANDS, module_of
from wavesweep.controllers import CONTROLLERS, Controller
from wavesweep.loops.controllers import keys_of_page
from wavesweep.stability import stable_intervals
from wavesweep.sweep.open_loops import wall_cut
from wavesweep.tables import HOMES

SPAN = (0.0, 20000.0)


@pytest.fixture
def smooth(monkeypatch):
    """Values of the document's controller, drawn by the function that a maintainer would register."""
    monkeypatch.setitem(CONTROLLERS, "dc-smooth", Controller("", code("Add a controller")["dc_smooth"]))
    return lambda **changes: values_of("dc-smooth", **changes)


def frame_matrix(values, K, B):
    """The loop of the document tick by tick: its map of (x, v, filter, held force) over a frame.

    The device by the matrix exponential, LP1 as scipy's second-order sections, the wall's force where the delay puts it.
    """
    T, m, d = 1 / values["rates.fast_hz"], values["device.mass"], values["device.damping"]
    whole = expm(np.array([[0, 1, 0], [0, -d / m, 1 / m], [0, 0, 0]]) * T)
    step, push = whole[:2, :2], whole[:2, 2]
    sections = signal.butter(values["filters.lp1.order"], values["filters.lp1.cutoff_hz"], fs=1 / T, output="sos")
    units = np.eye(3 + 2 * len(sections))  # every state at one in turn, all marched at once
    device, held = units[:2], units[-1]
    memory = units[2:-1].reshape(len(sections), 2, -1).transpose(0, 2, 1)
    fresh = K * device[0] + B * device[1]
    for phase in range(values["rates.ratio"]):
        force = fresh if phase >= values["environment.delay"] else held
        filtered, memory = signal.sosfilt(sections, force[:, None], zi=memory)
        device = step @ device - np.outer(push, filtered[:, 0])
    return np.vstack([device, memory.transpose(0, 2, 1).reshape(2 * len(sections), -1), fresh])


def radius(values, K, B):
    """Spectral radius of the loop that runs tick by tick."""
    return np.abs(np.linalg.eigvals(frame_matrix(values, K, B))).max()


CASES = [{}, {"delay": 7, "lp1_order": 2, "lp1_cutoff_hz": 40.0}, {"delay": 20, "lp1_order": 3, "lp1_cutoff_hz": 80.0}]


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("changes", CASES)
def test_a_controller_from_outside_has_the_stable_intervals_of_its_loop(smooth, changes):
    """Stable just inside and unstable just outside of every end, and labelled right everywhere on a scan."""
    values = smooth(**changes)
    damping = np.array([0.0, 0.5, 1.0, 4.0])
    found = stable_intervals(wall_cut(values).at(np.newaxis), "K_VE", SPAN, damping[None])
    assert found.certified.all()
    assert np.isfinite(found.high_omega).sum() >= 3
    for column, B in enumerate(damping):
        mine = (found.column == column) & (found.index >= 0)
        low, high = found.low[mine], found.high[mine]
        ends = [*low[np.isfinite(found.low_omega[mine])], *high[np.isfinite(found.high_omega[mine])]]
        near = [end * (1 + side) for end in ends for side in (-1e-6, 1e-6) if end > 0]
        for K in (*near, *np.geomspace(0.3, SPAN[1], 40)):
            assert (radius(values, K, B) < 1) == bool(np.any((low < K) & (high > K))), (K, B)


def test_a_controller_from_outside_reads_the_keys_of_its_drawing(smooth):
    read = keys_of_page(smooth())
    assert {"environment.delay", "filters.lp1.order", "filters.lp1.cutoff_hz", "environment.K_VE"} <= read
    assert not {"controller.b", "local_model.K_LM", "filters.hp.order"} & read


def test_the_analysis_of_the_document_is_how_fast_the_loop_dies_away():
    """Over a batch of loops and walls, before a program that runs tick by tick; NaN where it is unstable."""
    time_constant = code("Add an analysis")["time_constant"]
    delays, stiffness = np.array([0, 5, 20]), np.array([50.0, 150.0, 5000.0])
    wire = {"lp1_order": 0}
    for delay in delays.tolist():
        cut = wall_cut(values_of("dc-slow", delay=delay, **wire))
        found = time_constant(cut, stiffness, 1.0)
        for K, seconds in zip(stiffness.tolist(), found.tolist(), strict=True):
            size = radius(values_of("dc-slow", delay=delay, **wire), K, 1.0)
            assert np.isnan(seconds) if size >= 1 else seconds == pytest.approx(-0.02 / np.log(size), rel=1e-9)
    assert np.isnan(found[-1])


def test_an_analysis_stands_where_the_document_says():
    """The one that the document tells to follow has a row in both tables and a place in each of the four stages."""
    assert {"passivity"} <= COMMANDS.keys() & HOMES.keys()
    assert module_of("passivity") == "wavesweep.cli.passivity"
    assert hasattr(plots, "passivity")
    for stage in ("sweep", "cli"):
        assert list((ROOT / "wavesweep" / stage).glob("passivity*")), stage
