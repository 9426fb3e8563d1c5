"""What `stability-region --map` computes: a plane of two or three numbers in parts."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from wavesweep.engine.drawing import name_of
from wavesweep.engine.errors import UsageError
from wavesweep.maps.covering import OPEN, Plane, covered, scaled
from wavesweep.maps.rectangle import largest_about
from wavesweep.program.spec import Axis, Spec, sweep_axes
from wavesweep.program.tables.table import Table, facts_of

SHARE_OPEN = {2: 0.005, 3: 0.05}  # of the plane of so many numbers, that may stay open by default
MOST_PARTS = 40_000  # that are tried: some 20 s
PLACES = ("first", "second", "third")
METHOD = (
    "in each part a quadratic form that is a polynomial of the numbers: if P - A' P A > 0 for the frame A, which is enclosed as a "
    "Taylor model, as many eigenvalues are outside the unit circle as P has negative ones; by Cholesky with bounds on all errors"
)


def stability_map(
    spec: Spec,
    names: Sequence[str],
    wanted: float | None = None,
    report: Callable[[int, int, None], None] | None = None,
) -> Table:
    """The parts of the plane of some numbers, over their ranges in [sweep] or else from a tenth of
    the spec's value to ten times that.

    wanted: the share of the plane that may stay open, by default that of SHARE_OPEN. report: see `covered`.
    Errors: UsageError, SpecError for numbers or specs that have no such plane.
    """
    from wavesweep.program.analyses.assumptions import notices_of
    from wavesweep.program.analyses.claims import STABLE, Claim, Status, own_scope
    from wavesweep.program.spec.loading import naming
    from wavesweep.program.sweep.grid import make_grid, own_loop

    started = time.perf_counter()
    spec = naming(spec, names)
    spec.refuse_require("stability-region --map")
    axes = _axes(spec, names)
    paths = [axis.path for axis in axes]
    loop = own_loop(spec)
    if not any(placed.block.states for placed in loop.drawn().placed):
        raise UsageError("--map: expected a loop with states, found none: nothing is to be proved")
    if timed := [axis.name for axis in axes if name_of(axis.path) in loop.drawing.timing]:
        raise UsageError(
            f"--map: expected numbers that no dead time follows from, found {', '.join(timed)}"
        )
    wanted = wanted or SHARE_OPEN[len(axes)]
    ends = np.array([(axis.start, axis.stop) for axis in axes], float).T
    logarithmic = np.array([axis.scale == "log" for axis in axes])
    plane = covered(loop, paths, ends, logarithmic, wanted, MOST_PARTS, report)
    own = np.array([spec.own(path) for path in paths], float)
    about = None
    if len(axes) == 2:
        obstacles = scaled(plane.ends[plane.outside != 0], logarithmic)
        about = largest_about(scaled(own, logarithmic), scaled(ends, logarithmic), obstacles)
    if about is not None:
        about[:, logarithmic] = np.exp(about[:, logarithmic])
    proved = int((plane.outside != OPEN).sum())
    counts = {"computed": len(plane.outside), "skipped": 0, "certified": proved}
    timings = {"compute_s": time.perf_counter() - started}
    facts = facts_of(
        spec,
        {"stability-map": METHOD},
        counts,
        timings,
        notices_of(make_grid(spec, axes)),
        paths,
        claims={"spec": Claim(STABLE, own_scope(spec), Status.PROVED)},
    )
    facts |= {
        "numbers": [*names],
        "wanted": wanted,
        "ends": ends.tolist(),
        "logarithmic": logarithmic.tolist(),
        "own": own.tolist(),
        "about": None if about is None else np.clip(about, *ends).tolist(),
    }
    return Table.of("stability-map", _columns(plane), facts)


def _columns(plane: Plane) -> dict[str, np.ndarray]:
    """The parts of a plane in the order of their low ends."""
    order = np.lexsort(plane.ends[:, 0].T[::-1])
    columns: dict[str, np.ndarray] = {}
    for ends, place in zip(plane.ends[order].transpose(2, 1, 0), PLACES, strict=False):
        columns[f"{place}_low"], columns[f"{place}_high"] = ends
    outside = plane.outside[order]
    kinds = np.where(outside == OPEN, "open", np.where(outside == 0, "stable", "unstable"))
    columns["proved"] = kinds.astype(object)
    columns["outside"] = np.where(outside == OPEN, np.nan, outside)
    columns["share"] = plane.share[order]
    return columns


def _axes(spec: Spec, names: Sequence[str]) -> list[Axis]:
    """The numbers of a map with their ranges."""
    if len(names) not in SHARE_OPEN or len({*names}) < len(names):
        raise UsageError(
            f"--map: expected two or three numbers, as --map K,b, found {','.join(names) or 'none'}"
        )
    axes = [sweep_axes(spec, name, swept=False)[0] for name in names]
    if fixed := [axis.name for axis in axes if axis.structural]:
        raise UsageError(
            f"--map: expected numbers that do not decide how the loop is built, found {', '.join(fixed)}"
        )
    return axes
