"""The figures of a broken loop, held against a program of their own: a mass, moved by a held force."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.linalg import expm

import wavesweep
from wavesweep.margins.figure import _closed_step, _draw_marks, draw_bode, draw_nyquist
from wavesweep.margins.figure import open_loop as open_loop_of
from wavesweep.margins.table import margins
from wavesweep.program import plots
from wavesweep.program.plots.style import as_asked

FRAME, MASS, DAMPING, SPRING = 5e-3, 0.1, 0.02, 250.0
KP, KD = 20.0, 0.4
PANELS = ("nyquist", "gain", "phase", "step")


def drive(kp=KP):
    """A weakly damped mass on a spring, whose force is held over five ticks."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": kp, "kd": KD},
        "block": {
            "m": {"type": "mass", "mass": MASS, "damping": DAMPING},
            "ground": {"type": "spring", "k": SPRING},
            "s": {"type": "hold", "every": 5},
        },
        "wire": {"s.u": "-kp*m.x - kd*m.v", "m.f": "s.y + ground.f1", "ground.x1": "m.x"},
    }


def sampled():
    """The motion of the mass over a frame: its matrix, and what a held force of 1 N adds."""
    whole = expm(FRAME * np.array([[0, 1, 0], [-SPRING / MASS, -DAMPING / MASS, 1 / MASS], [0, 0, 0]]))
    return whole[:2, :2], whole[:2, 2]


def open_loop(theta, kp=KP):
    A, b = sampled()
    z = np.exp(1j * theta)[:, None, None]
    return np.linalg.solve(z * np.eye(2) - A, np.broadcast_to(b[:, None], (len(theta), 2, 1)))[..., 0] @ np.array([kp, KD])


def far_from(points, line):
    """The distance of each point from a line, in the units of the axes."""
    a, b = line[:-1, None], line[1:, None]
    along = b - a
    share = np.clip(((points - a) * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-300), 0, 1)
    return np.linalg.norm(points - a - share[..., None] * along, axis=-1).min(0)


def test_a_zero_on_the_circle_leaves_the_axis_to_the_gains_of_margins():
    spec = drive()
    spec["block"]["n"] = {"type": "notch", "frequency_hz": 15, "q": 1, "depth": 0, "every": 5}
    spec["wire"]["n.u"] = spec["wire"]["s.u"]
    spec["wire"]["s.u"] = "n.y"
    gain, phase = Figure().subplots(2, 1)
    draw_bode(gain, phase, open_loop_of(wavesweep.load(spec), "s.y", {}))
    assert gain.lines[0].get_ydata().min() < -150
    assert -115 < gain.get_ylim()[0] < -90


@pytest.mark.slow
def test_a_resonance_is_smooth_and_no_word_leaves_a_narrow_figure():
    table = margins(wavesweep.load(drive()), "s.y")
    with as_asked(85 / 25.4):
        figure = plots.margins(table.columns, table.facts)
    axes, gain, phase, _ = (next(each for each in figure.axes if each.get_label() == name) for name in PANELS)
    curve = max(axes.lines, key=lambda line: len(line.get_xdata())).get_xydata()
    pixel = np.ptp(axes.get_xlim()) / axes.get_window_extent().width
    theta = np.concatenate([np.linspace(1e-4, np.pi, 4000), 0.25 + np.linspace(-1e-3, 1e-3, 4000)])
    L = open_loop(theta)
    shown = (np.abs(L.real) < 2) & (np.abs(L.imag) < 2)
    dense = np.stack([L.real, L.imag], -1)[shown][::7]
    assert far_from(dense, curve).max() < 0.5 * pixel
    texts = [*figure.legends[0].get_texts(), axes.xaxis.label, gain.yaxis.label, phase.xaxis.label]
    boxes = [text.get_window_extent() for text in texts]
    assert min(box.x0 for box in boxes) >= 0
    assert max(box.x1 for box in boxes) <= figure.bbox.x1


def draw_loop(axes, loop):
    """The names in the Nyquist plot of a lifted loop, whose eigenvalues have no order and are points."""
    axes.clear()
    draw_nyquist(axes, loop, "c.y", ())
    assert [axes.lines[line].get_marker() for line in (1, 2)] == [".", "."]
    return axes.get_legend_handles_labels()[1]


def test_a_fast_signal_has_a_bode_plot_up_to_half_its_own_rate_with_marks_at_its_lines():
    """Two loops that do not act on each other: one at 1 kHz, with one crossing of the gain 1, and one with frames of 4 ms."""
    fast = {"c": {"type": "gain", "k": "kp"}, "lag": {"type": "tf", "num": [1], "den": [0.001, 1]}}
    slow = {"s": {"type": "gain", "every": 4}, "far": {"type": "tf", "num": [1], "den": [0.1, 1]}}
    wire = {"c.u": "-lag.y", "lag.u": "c.y", "s.u": "-far.y", "far.u": "s.y"}
    pole, kp = np.exp(-1.0), 1.5
    spec = {"rates": {"tick_hz": 1000}, "numbers": {"kp": kp}, "block": fast | slow, "wire": wire}
    cosine = (1 + pole**2 - (kp * (1 - pole)) ** 2) / (2 * pole)  # |kp (1 - pole)/(z - pole)| is 1 there
    hertz = np.arccos(cosine) / (2e-3 * np.pi)
    turn = 180 - abs(np.degrees(np.angle(kp * (1 - pole) / (np.exp(2e-3j * np.pi * hertz) - pole))))
    assert 125 < hertz < 250
    folded = 2 * np.pi * (250 - hertz)
    loop = open_loop_of(wavesweep.load(spec), "c.y", {"phase": (turn, folded, hertz)})
    gain, phase = Figure().subplots(2, 1)
    draw_bode(gain, phase, loop)
    shown, decibels = gain.lines[0].get_data()
    exact = kp * (1 - pole) / (np.exp(2e-3j * np.pi * shown) - pole)
    np.testing.assert_allclose(decibels, 20 * np.log10(np.abs(exact)), atol=1e-9)
    assert gain.get_xlim()[1] == pytest.approx(500, rel=1e-12) == shown[-1]
    for axes, expected in ((gain, 0.0), (phase, turn - 180)):
        (mark,) = [line.get_xydata()[0] for line in axes.lines if line.get_marker() == "o"]
        assert mark == pytest.approx([hertz, expected], abs=1e-6)
    assert "eigenvalues of L at c.y" in draw_loop(gain, loop)
    later = SimpleNamespace(bode=(shown, exact), marks={"phase": loop.marks["phase"]}, place=loop.place)
    _draw_marks(phase, later, np.degrees(np.angle(exact)) - 360, 1.0, of_gain=False)  # a turn behind, up to -540
    assert phase.lines[-2].get_ydata().tolist() == pytest.approx([turn - 540, -540])


def test_a_step_at_a_signal_of_plants_that_act_on_each_other_is_that_behind_a_gain():
    spec = drive()
    spec["block"]["end"] = {"type": "mass", "mass": 0.2, "damping": 0.3}
    spec["signals"] = {"pull": "40*(end.x - m.x)", "place": "m.x"}
    spec["wire"] |= {"m.f": "s.y + ground.f1 + pull", "end.f": "-pull", "s.u": "-kp*place - kd*m.v"}
    alone, behind = (_closed_step(wavesweep.load(spec), cut) for cut in ("m.x", "place"))
    np.testing.assert_allclose(alone.value[::5], behind.value[::5], atol=1e-9)  # where both run


def test_a_loop_without_margins_of_gain_has_a_figure():
    block = {"g": {"type": "gain", "k": -0.5}, "h": {"type": "delay", "steps": 0, "every": 2}}
    spec = wavesweep.load({"rates": {"tick_hz": 10}, "block": block, "wire": {"g.u": "h.y", "h.u": "g.y"}})
    gain, phase = Figure().subplots(2, 1)
    draw_bode(gain, phase, open_loop_of(spec, "h.y", {}))
    assert gain.get_ylim()[0] < 20 * np.log10(0.5) < gain.get_ylim()[1]
