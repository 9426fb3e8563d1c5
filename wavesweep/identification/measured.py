"""How far a spec's own design is from what was measured of the device: limits, walls that were
tried, a response."""

from __future__ import annotations

from typing import Any

import numpy as np

from wavesweep.engine.drawing import name_of
from wavesweep.engine.response import respond
from wavesweep.identification.points import FrequencyResponse, MeasuredWalls, response_of, walls_of
from wavesweep.program.analyses.asked import axes_asked, axis_along
from wavesweep.program.analyses.interval_jobs import job_over
from wavesweep.program.analyses.spec_loops import loop_at_hand
from wavesweep.program.columns import INCOMPLETE
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import make_grid
from wavesweep.program.sweep.running import in_memory

# times the largest stiffness that was measured, up to which limits are looked for
FARTHEST_LIMIT = 10.0
# of their median: limits without repetition are explained if the model is off by less, rms
EXPLAINED_RMS = 0.1
REPEATED = 5  # repetitions, below which scatter is hardly known, and an F test lets everything pass
F_LEVEL = 0.99  # of the F distribution, up to which limits with repetitions are explained

Points = tuple[MeasuredWalls | None, FrequencyResponse | None]


def read_points(spec: Spec) -> Points:
    """What [measured] names, before anything is computed. Errors: UsageError for a file that
    cannot be used."""
    return walls_of(spec), response_of(spec)


def distances(spec: Spec, points: Points, stable: bool) -> dict[str, Any]:
    """How far the spec's own design is from its points, as a JSON-able dict; a missing number is
    None.

    stable: whether the design is; only then its response is compared. limits: see `_limits`; tried:
    see `_tried`; response: see `_response`.
    """
    walls, response = points
    distances_found: dict[str, Any] = {}
    if walls is not None:
        columns = _stable_intervals(spec, walls)
        if walls.stable is None:
            distances_found = {"limits": _limits(walls, columns)}
        else:
            distances_found = {"tried": _tried(walls, columns)}
        distances_found = {
            name: {"file": spec.measured["z_width"]} | comparison
            for name, comparison in distances_found.items()
        }
    if response is not None:
        distances_found["response"] = {"file": spec.measured["response"]} | _response(
            spec, response, stable
        )
    return distances_found


def _stable_intervals(
    spec: Spec, walls: MeasuredWalls
) -> list[tuple[list[tuple[float, float, bool]], bool]]:
    """For each wall, the stable intervals of stiffness at its damping, as (low, high, whether high
    is an end of stability).

    Beside them is whether all of the column is known.
    """
    stiffness, damping = spec.wall
    number = axis_along(
        spec,
        name_of(stiffness) if spec.drawing else "K_VE",
        (0.0, FARTHEST_LIMIT * max(walls.K_VE.max(), 1.0)),
    )
    values, place = np.unique(walls.B_VE, return_inverse=True)
    axes = axes_asked(spec, {name_of(damping) if spec.drawing else "B_VE": values}, number)
    rows = in_memory(job_over(make_grid(spec, axes, number.path), number))
    intervals_of: dict[float, tuple[list[tuple[float, float, bool]], bool]] = {}
    for row, value in enumerate(rows[axes[0].name].tolist()):
        intervals, _ = intervals_of.setdefault(
            value, ([], str(rows["doubt"][row]) not in INCOMPLETE)
        )
        if rows["intervals"][row]:
            ends = bool(np.isfinite(rows["high_omega"][row]))
            intervals.append(
                (
                    float(rows["low"][row]),
                    float(rows["high"][row]),
                    ends or rows["high"][row] < number.stop,
                )
            )
    return [intervals_of[values[row]] for row in place.ravel().tolist()]


def _limits(walls: MeasuredWalls, columns) -> dict[str, Any]:
    """The limit that the model has in place of each measured one: ratio, rms, and on which side the
    model errs.

    A wall was stable just below a limit, and unstable just above. If the limit lies in a stable
    interval of the model, it is compared with the upper end of that; otherwise the model became
    unstable at the upper end of the next interval below, and 0 stands for none. So a limit above a
    hole is compared with the end above the hole. beyond: the model has no limit up to
    FARTHEST_LIMIT times the largest one measured, and its ratio is at least that.
    """
    points = []
    for B, K, (intervals, complete) in zip(
        walls.B_VE.tolist(), walls.K_VE.tolist(), columns, strict=True
    ):
        below = [interval for interval in intervals if interval[0] <= K]
        low, high, ends = below[-1] if below else (0.0, 0.0, True)
        hole = len(below) > 1 or low > 0
        point = {"B_VE": B, "K_VE": K, "computed": high, "ratio": high / K, "beyond": not ends}
        point["above_hole"] = hole
        points.append(point if complete else point | {"computed": None, "ratio": None})
    complete = [point for point in points if point["ratio"] is not None]
    ratios = np.array([point["ratio"] for point in complete])
    summary = {
        "count": len(points),
        "compared": len(complete),
        "more": int((ratios > 1).sum()),
        "less": int((ratios < 1).sum()),
        "above_hole": sum(point["above_hole"] for point in complete),
        "beyond": sum(point["beyond"] for point in complete),
        "median_ratio": float(np.median(ratios)) if complete else None,
        "worst": max(complete, key=lambda limit: _far(limit["ratio"]), default=None),
        "most_promised": max(
            (point for point in complete if point["ratio"] > 1),
            key=lambda limit: limit["ratio"],
            default=None,
        ),
    }
    return summary | _explained(complete) | {"points": points}


def _far(ratio: float) -> float:
    return abs(np.log(ratio)) if ratio > 0 else np.inf


def _explained(computed: list[dict[str, Any]]) -> dict[str, Any]:
    """rms of computed minus measured (N/m), its share of the median limit, and whether the model
    explains the limits.

    If limits were measured again at the same damping, REPEATED times or more in all, their scatter
    (N/m) is what the model is held against: it explains them if the means are off by no more than
    repetitions are, by an F test at F_LEVEL with no number fitted. Otherwise the rms is held
    against EXPLAINED_RMS of the median.
    """
    if not computed:
        return {"rms": None, "share": None, "scatter": None, "explained": None}
    off = np.array([point["computed"] - point["K_VE"] for point in computed])
    rms = float(np.sqrt(np.mean(off**2)))
    share = rms / float(np.median([point["K_VE"] for point in computed]))
    place = np.unique([point["B_VE"] for point in computed], return_inverse=True)[1].ravel()
    repeats = np.bincount(place)
    means = np.bincount(place, off) / repeats
    spare = len(off) - len(means)
    if spare < REPEATED:
        return {"rms": rms, "share": share, "scatter": None, "explained": share <= EXPLAINED_RMS}
    from scipy.special import fdtri

    scatter = float(np.sum((off - means[place]) ** 2) / spare)
    explained = float(np.mean(repeats * means**2)) <= fdtri(len(means), spare, F_LEVEL) * scatter
    return {
        "rms": rms,
        "share": share,
        "scatter": float(np.sqrt(scatter)),
        "explained": bool(explained),
    }


def _tried(walls: MeasuredWalls, columns) -> dict[str, Any]:
    """How many of the walls that were tried are on the wrong side, and the worst ones.

    promised: unstable in the experiment, stable by the model, which is the dangerous side; denied:
    the other way round. Their ratio is that of the nearest end of stability over the stiffness that
    was tried; None without one, or of a stiffness of 0.
    """
    wrong: dict[str, list[dict[str, Any]]] = {"promised": [], "denied": []}
    unknown = 0
    tried = zip(
        walls.B_VE.tolist(), walls.K_VE.tolist(), walls.stable.tolist(), columns, strict=True
    )
    for B, K, stable, (intervals, complete) in tried:
        inside = [interval for interval in intervals if interval[0] <= K <= interval[1]]
        if not (inside or complete):
            unknown += 1
        elif bool(inside) != stable:
            ends = []
            for low, high, real in inside or intervals:
                if K > 0 and low > 0:
                    ends.append(low)
                if K > 0 and real:
                    ends.append(high)
            end = min(ends, key=lambda end: _far(end / K), default=None)
            point = {
                "B_VE": B,
                "K_VE": K,
                "stable": stable,
                "computed": end,
                "ratio": None if end is None else end / K,
            }
            wrong["denied" if stable else "promised"].append(point)
    numbers = {"count": len(columns), "stable": int(walls.stable.sum()), "not_known": unknown}
    numbers |= {"promised": len(wrong["promised"]), "denied": len(wrong["denied"])}
    order = sorted(
        wrong["promised"] + wrong["denied"], key=lambda wall: -_far(wall["ratio"] or 0.0)
    )
    # The worst three are named one by one.
    return numbers | {"wrong": len(order), "worst": order[:3]}


def _response(spec: Spec, measured: FrequencyResponse, stable: bool) -> dict[str, Any]:
    """Computed over measured admittance: ratios of magnitude and differences of phase (deg), their
    medians and worst.

    Frequencies above half the rate of the ticks, and points of low coherence, are not compared.
    """
    counts = {"count": len(measured.frequency_hz), "stable": stable}
    # Points below this coherence are left out.
    chosen = (measured.frequency_hz <= spec.tick_hz / 2) & (measured.coherence >= 0.5)
    nothing = {
        "compared": 0,
        "softer": 0,
        "median_ratio": None,
        "worst": None,
        "median_deg": None,
        "worst_phase": None,
    }
    if not (stable and chosen.any()):
        return counts | nothing
    hertz = measured.frequency_hz[chosen]
    quotient = respond(loop_at_hand(spec), hertz).admittance.ravel() / measured.admittance[chosen]
    usable = np.isfinite(quotient) & (quotient != 0)
    if not usable.any():
        return counts | nothing
    hertz = hertz[usable]
    quotient = quotient[usable]
    ratio = np.abs(quotient)
    degrees = np.degrees(np.angle(quotient))
    rows = zip(hertz.tolist(), ratio.tolist(), degrees.tolist(), strict=True)
    points = [dict(zip(("frequency_hz", "ratio", "deg"), row, strict=True)) for row in rows]
    return counts | {
        "compared": len(points),
        "softer": int((ratio > 1).sum()),
        "median_ratio": float(np.median(ratio)),
        "worst": max(points, key=lambda point: _far(point["ratio"])),
        "median_deg": float(np.median(degrees)),
        "worst_phase": max(points, key=lambda point: abs(point["deg"])),
    }
