"""What was measured, as points next to computed curves; the facts of a run have them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from wavesweep.core.plots.words import as_it_stands
from wavesweep.core.reading.keys import SYMBOLS

Facts = Mapping[str, Any]
Walls = Mapping[bool | None, np.ndarray]

_POINT = {"linestyle": "none", "marker": "o", "markersize": 4, "zorder": 6}
_EDGE = {"markeredgecolor": "white", "markeredgewidth": 0.5}
_OF_RESPONSE = _POINT | {"markersize": 3, "markerfacecolor": "none", "markeredgewidth": 0.8, "zorder": 3}
_HOLLOW = {"markerfacecolor": "white", "markeredgewidth": 1.0}
KINDS = {None: "measured limit", True: "measured stable", False: "measured unstable"}


def _look(kind: bool | None, colour: Any) -> dict[str, Any]:
    """The look of a point: a limit is a diamond, a wall that was tried is a disc if it was stable, otherwise a ring."""
    if kind is False:
        return _POINT | _HOLLOW | {"color": colour}
    return _POINT | _EDGE | {"color": colour, "marker": "D" if kind is None else "o"}


def walls_by_kind(facts: Facts, spec: str) -> Walls:
    """The measured walls of a spec, `(2, points)`: damping and stiffness, by whether they were stable; None are limits."""
    points = facts.get("measured", {}).get(spec, {}).get("z_width")
    if not points:
        return {}
    walls = np.array([points["B_VE"], points["K_VE"]])
    if "stable" not in points:
        return {None: walls}
    stable = np.array(points["stable"])
    return {kind: walls[:, stable == kind] for kind in (True, False) if (stable == kind).any()}


def walls_in_plane(facts: Facts, x: str | None, along: str) -> Walls:
    """The same for the only spec of a run, if its figure has the wall's damping along it and its stiffness upwards."""
    wall = facts.get("spec", {}).get("ports", {}).get("wall")
    names = ("B_VE", "K_VE") if wall is None else (wall["damping"], wall["stiffness"])
    if (x, along) not in (names, tuple(SYMBOLS.get(name, name) for name in names)):
        return {}
    return walls_by_kind(facts, str(facts.get("spec_name", "")))


def draw_walls(axes: Any, walls: Walls, colour: Any = "black") -> None:
    """Draw the walls within the limits of the axes, which have to be set; those on the frame are not cut off."""
    for kind, points in walls.items():
        spans = zip(points, (axes.get_xlim(), axes.get_ylim()), strict=True)
        inside = np.all([(each >= low) & (each <= high) for each, (low, high) in spans], axis=0)
        if inside.any():
            axes.plot(*points[:, inside], **_look(kind, colour), clip_on=False)


def wall_handles(walls: Walls, x: tuple[float, float], y: tuple[float, float], colour: Any = "black") -> list[Any]:
    """The entries of a legend, with the number of points outside of the spans x and y that a figure shows."""
    from matplotlib.lines import Line2D

    handles = []
    for kind, points in walls.items():
        outside = sum(not (x[0] <= B <= x[1] and y[0] <= K <= y[1]) for B, K in points.T.tolist())
        said = f" ({outside} of {points.shape[1]} outside)" if outside else ""
        handles.append(Line2D([], [], **_look(kind, colour), label=KINDS[kind] + said))
    return handles


def undrawn(facts: Facts, x: str | None, along: str) -> str:
    """A sentence about measured walls that a figure with another plane does not show; empty if there are none."""
    walls = walls_by_kind(facts, str(facts.get("spec_name", "")))
    if not walls or walls_in_plane(facts, x, along):
        return ""
    return "The measured walls are not shown: they are of stiffness over damping of the wall."


def coloured(facts: Facts, part: str, colours: Mapping[str, Any]) -> dict[str, Any]:
    """The specs with measured points of a part, "z_width" or "response", and their colours.

    Of those that have the same points there is the first alone, in black.
    """
    same: dict[str, list[str]] = {}
    for spec in colours:
        if points := facts.get("measured", {}).get(spec, {}).get(part):
            same.setdefault(points["sha256"], []).append(spec)
    alone = len(colours) == 1
    return {each[0]: "black" if alone or len(each) > 1 else colours[each[0]] for each in same.values()}


def draw_responses(axes: Any, facts: Facts, name: str, colours: Mapping[str, Any]) -> np.ndarray:
    """Draw the measured responses of specs, and give their frequencies (Hz), which all panels at the hand show.

    name: of a column; none is drawn if it is not one of admittances. colours: of the specs, see `coloured`.
    """
    places = [np.zeros(0)]
    for spec, colour in coloured(facts, "response", colours).items():
        points = facts["measured"][spec]["response"]
        H, hertz = np.array(points["re"]) + 1j * np.array(points["im"]), np.array(points["frequency_hz"])
        if name.startswith("admittance"):
            label = "measured" if colour == "black" else f"{as_it_stands(spec)}, measured"
            values = 1e3 * np.abs(H) if name == "admittance_abs" else np.degrees(np.angle(H))  # mm/N
            axes.plot(hertz, values, color=colour, label=label, **_OF_RESPONSE)
        places += [hertz] if name.startswith(("admittance", "impedance")) else []
    return np.concatenate(places)
