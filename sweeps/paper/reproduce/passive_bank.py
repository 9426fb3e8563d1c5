"""A filter bank whose way in is passive, which the paper's is not, and its cost in transparency.

The way in adds two returned waves: `v_m = hold(v_s) + LP2 v_l`. Weigh each wave by the root of its own period and lift
over a frame of M ticks. At the angle theta per frame, in the basis of its images `phi_m = (theta + 2 pi m)/M`, the map
from `(v_s, v_l)` to `v_m` is

    N = [c, diag(LP2(phi_m))],   |c_m| = |sin(theta/2) / (M sin(phi_m/2))|,   sum |c_m|^2 = 1,

c being the hold, which keeps the energy of a frame. The way in is passive if N N* = c c* + diag |LP2_m|^2 <= I. The page of
this study (`documents.bank_text`) proves that no LP2 makes it so, and that F1 behind the hold and F2 in LP2's place do, with
|F1|^2 + |F2|^2 = 1 at every frequency.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from reproduce.drawing import Line, Panel, draw_magnitudes
from reproduce.felt_responses import HIGH, LOW, FeltResponse, deviation, respond, respond_to
from reproduce.resolvent import alias_angles, solved_response
from reproduce.specs import load_paper
from wavesweep.engine._loops.block import Block
from wavesweep.engine._monodromy.unit_circle import on_circle
from wavesweep.engine.loop import Loops
from wavesweep.haptics.controller_page import BlockDiagram, drawing_of_page
from wavesweep.haptics.pmw import pmw, pmw_lm
from wavesweep.program.results import Field
from wavesweep.program.tables.table import Table, facts_of

ORDERS, CUTOFFS_HZ = (1, 2), (5.0, 10.0, 20.0, 40.0, 80.0)
ANGLES = np.concatenate([np.geomspace(1e-6, 0.1, 60), np.linspace(0.1, np.pi, 300)])
PLAIN, AS_DRAWN, SCALED, IN_PLACE, BEHIND = "PMW", "PMW+LM", "waves over root 2", "F2 for LP2", "F2 after LP2"

FIELDS = (
    Field(
        "design",
        "string",
        "",
        f"{PLAIN}; {AS_DRAWN}, Figure 6's; that with both {SCALED}, or with F1 behind the hold and {IN_PLACE} or {BEHIND}",
    ),
    Field("order", "integer", "1", "order of F1 and F2; 0 without these filters"),
    Field("cutoff_hz", "number", "Hz", "their cutoff; 0 without these filters"),
    Field("local_delay", "integer", "tick", "delay of the local model's wave"),
    Field("inward_norm", "number", "1", "norm of the lifted way in, largest over angles from 0 to pi"),
    Field("stable", "boolean", "", "whether the loop is stable with the wall of Figure 6"),
    Field("low", "number", "1", "mean deviation of the admittance's magnitude from DC's up to 0.6 rad/sample"),
    Field("high", "number", "1", "the same above 0.6 rad/sample"),
    Field("felt", "number", "N/m", "stiffness that the hand feels at 0.05 Hz"),
    Field("felt_without_Kp", "number", "N/m", "the same with Kp = 0"),
)
_HELD, _LOCAL = (
    ("v_1", "f1.", "avatar.out"),
    ("lp2.", "f2.", "v_2."),
)  # beginnings of the signals of v_m that come from either wave
METHODS = {
    "inward_norm": "largest eigenvalue over the images of each angle",
    "admittance": "lifted resolvent of both rates, component at the force's own frequency",
}


@dataclass(frozen=True)
class Design:
    """A filter bank: its name, order and cutoff (Hz) of F1 and F2 (0 without them), delay of the local model in ticks."""

    name: str
    order: int
    cutoff_hz: float
    local_delay: int


DESIGNS = (
    Design(PLAIN, 0, 0.0, 1),
    *(Design(name, 0, 0.0, delay) for name in (AS_DRAWN, SCALED) for delay in (1, 0)),
    *(
        Design(name, order, cutoff, delay)
        for name, delay in ((IN_PLACE, 1), (IN_PLACE, 0), (BEHIND, 1))
        for order in ORDERS
        for cutoff in CUTOFFS_HZ
    ),
)
SHOWN = (  # in the figure
    Design(AS_DRAWN, 0, 0.0, 1),
    Design(PLAIN, 0, 0.0, 1),
    Design(IN_PLACE, 1, 10.0, 0),
    Design(BEHIND, 1, 10.0, 1),
    Design(SCALED, 0, 0.0, 1),
)


def page(design: Design, values) -> BlockDiagram:
    """Return the page of the loop of `values` with the design's filters: F1 between hold and sum, F2 on the local wave."""
    whole = (pmw if design.name == PLAIN else pmw_lm)(values)
    blocks, wires = dict(whole.blocks), dict(whole.wires)
    end, v_2 = wires["encoder.in"], "v_2.y" if "v_2" in blocks else "lp2.y"
    v_1 = end.split(" + ")[0]
    if design.name == SCALED:
        wires["encoder.in"] = end.replace(v_1, f"{0.5**0.5!r}*{v_1}").replace(v_2, f"{0.5**0.5!r}*{v_2}")
    if not design.order:
        return replace(whole, wires=wires)
    keys = {"type": "butterworth", "order": design.order, "cutoff_hz": design.cutoff_hz}
    blocks |= {"f1": keys | {"pass": "low"}, "f2": keys | {"pass": "high"}}
    wires |= {"f1.u": v_1, "encoder.in": end.replace(v_1, "f1.y").replace("lp2.y", "f2.y")}
    wires["f2.u"] = "lp2.y" if design.name == BEHIND else "local.out"
    if "v_2" in blocks:
        wires["v_2.u"] = "f2.y"
    if design.name != BEHIND:
        del blocks["lp2"], wires["lp2.u"]
    return BlockDiagram(blocks, wires, whole.reaction)


def inward_norm(page: BlockDiagram, values) -> float:
    """Norm of the way in, `(v_s, v_l) -> v_m`, by its blocks: the largest of `N N* = diag|F2|^2 + F1 c (F1 c)*` over angles.

    The angle 0, at which the hold is (1, 0, ..., 0), is among them. F1 and F2 are all that each wave passes.
    """
    drawn = Loops(drawing_of_page(page), values).drawn()
    blocks, gains = {each.block.name: each.block for each in drawn.placed}, drawn.sums["encoder.in"]
    theta = np.concatenate([[0.0], ANGLES])
    phi = alias_angles(theta, drawn.ticks)
    local, held = (
        max((abs(gain) for signal, gain in gains.items() if signal.startswith(names)), default=0.0) for names in (_LOCAL, _HELD)
    )
    for block in (blocks[name] for name in ("lp2", "f2") if name in blocks):
        local = local * np.sqrt(_power(block, phi))
    if "f1" in blocks:
        held = held * np.sqrt(_power(blocks["f1"], phi))
    own = np.broadcast_to(local**2, phi.shape)
    return float(np.sqrt(largest(own, held**2 * held_power(theta, phi)).max()))


def held_power(theta, phi):
    """`|c_m|^2`, the power that a hold puts into each image of its frequency."""
    ratio = phi.shape[-1]
    below = ratio * np.sin(phi / 2)
    return np.where(below == 0, 1.0, np.sin(theta / 2)[..., None] / np.where(below == 0, 1.0, below)) ** 2


def _power(block: Block, phi) -> np.ndarray:
    found = solved_response(block, on_circle(phi.reshape(-1)))
    return np.abs(found[:, 0, 0].reshape(phi.shape)) ** 2


def passive_bank() -> Table:
    """Compute every design: a row each."""
    started, ideal = time.perf_counter(), respond(load_paper("dc"))
    rows = [_row(design, ideal) for design in DESIGNS]
    columns = {field.name: np.array([row[field.name] for row in rows]) for field in FIELDS}
    columns["design"] = columns["design"].astype(object)
    counts = {"computed": len(rows), "skipped": 0, "certified": 0}
    facts = facts_of(load_paper("fig6"), METHODS, counts, {"compute_s": time.perf_counter() - started})
    return Table.of("passive-bank", columns, facts, fields=FIELDS)


def _row(design: Design, ideal: FeltResponse) -> dict:
    """A design and its effects; no response if its loop is unstable."""
    found, without = (_response(design, Kp) for Kp in (20.0, 0.0))
    facts = {
        "low": deviation(found, ideal, LOW),
        "high": deviation(found, ideal, HIGH),
        "felt": 1 / np.abs(found.admittance[0]),
    }
    return {
        "design": design.name,
        "order": design.order,
        "cutoff_hz": design.cutoff_hz,
        "local_delay": design.local_delay,
        "inward_norm": inward_norm(page(design, _values(design, 20.0)), _values(design, 20.0)),
        "stable": found.stable,
        **(facts if found.stable else dict.fromkeys(facts, np.nan)),
        "felt_without_Kp": 1 / np.abs(without.admittance[0]) if without.stable else np.nan,
    }


def _values(design: Design, Kp: float) -> dict:
    if design.name == PLAIN:
        return dict(load_paper("pmw").values)
    return {**load_paper("fig6").values, "controller.Kp": Kp, "local_model.delay": design.local_delay}


def _response(design: Design, Kp: float) -> FeltResponse:
    values, frequency = _values(design, Kp), np.asarray(load_paper("fig6").frequency_hz)
    return respond_to(drawing_of_page(page(design, values)), values, 1, frequency)[0]


def figure():
    """Give the function that draws the admittance of some designs."""
    lines = []
    for hue, design in enumerate(SHOWN):
        found = _response(design, 20.0)
        label = f"{design.name}, no delay" if design.local_delay == 0 else design.name
        lines.append(Line(label, found.omega, 1e3 * np.abs(found.admittance), hue=hue))
    ideal = respond(load_paper("dc"))
    lines.append(Line("DC", ideal.omega, 1e3 * np.abs(ideal.admittance), ideal=True))
    panels = tuple(Panel(band, logarithmic=False) for band in (LOW, HIGH))
    return partial(draw_magnitudes, lines, panels, "transmitted admittance (mm/N)")


ROUNDS = 60


def largest(diagonal, weight):
    """Largest eigenvalue of `diag(d) + l l*` with `weight = |l|^2`; arrays `(..., M)`, the result `(...)`.

    It is the root beyond max d of `sum weight/(x - d) = 1`. The reciprocal of the sum is concave and rises there
    (Bunch, Nielsen, Sorensen 1978), so Newton from max(d + weight), below the root, climbs to it without a guard.
    Accuracy: rounding.
    """
    x = (diagonal + weight).max(-1)
    for _ in range(ROUNDS):
        gap = x[..., None] - diagonal
        gap = np.where((gap > 0) & (weight > 0), gap, np.inf)  # an entry without weight is an eigenvalue of its own
        share = (weight / gap).sum(-1)
        slope = (weight / gap**2).sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(slope > 0, share * (share - 1) / slope, 0.0)
        x = x + np.maximum(step, 0)
        if np.all(step <= 4 * np.finfo(float).eps * np.abs(x)):
            break
    return x
