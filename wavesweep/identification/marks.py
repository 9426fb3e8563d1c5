"""What was measured, as points next to computed curves; the facts of a run have them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.identification.points import response_of, walls_of
from wavesweep.program.plots.labels import as_it_stands
from wavesweep.program.plots.member_panels import damping_of, specs_of
from wavesweep.program.plots.style import distinct_colour
from wavesweep.program.reading.keys import SYMBOLS
from wavesweep.program.spec import Spec

Facts = Mapping[str, Any]
ByKind = Mapping[bool | None, np.ndarray]

OF_WALLS = ("zwidth", "zwidth-hands", "stability-region", "stability-region-hands", "zwidth-specs")
OF_RESPONSES = ("bode",)

_POINT = {"linestyle": "none", "marker": "o", "markersize": 4, "zorder": 6}
_EDGE = {"markeredgecolor": "white", "markeredgewidth": 0.5}
_OF_RESPONSE = _POINT | {
    "markersize": 3,
    "markerfacecolor": "none",
    "markeredgewidth": 0.8,
    "zorder": 3,
}
_HOLLOW = {"markerfacecolor": "white", "markeredgewidth": 1.0}
KINDS = {None: "measured limit", True: "measured stable", False: "measured unstable"}


def facts_of(specs: Iterable[Spec], kind: str) -> dict[str, Any]:
    """The measured points for the figure of a table of that kind, as the fact `measured` of the
    run, if there are any.

    They are stored with the table, so that `plot` draws the points of the run. Errors: UsageError
    for a file that cannot be used.
    """
    marks: dict[str, Mapping[str, Any]] = {}
    for spec in specs if kind in OF_WALLS or kind in OF_RESPONSES else ():
        walls = walls_of(spec) if kind in OF_WALLS else None
        response = response_of(spec) if kind in OF_RESPONSES else None
        measured_marks: dict[str, Any] = {}
        if walls:
            measured_marks["z_width"] = {
                "B_VE": walls.B_VE.tolist(),
                "K_VE": walls.K_VE.tolist(),
                "sha256": walls.sha256,
            }
            measured_marks["z_width"] |= (
                {} if walls.stable is None else {"stable": walls.stable.tolist()}
            )
        if response:
            real_and_imaginary = {
                "re": response.admittance.real.tolist(),
                "im": response.admittance.imag.tolist(),
            }
            measured_marks["response"] = {
                "frequency_hz": response.frequency_hz.tolist(),
                **real_and_imaginary,
                "sha256": response.sha256,
            }
        if measured_marks:
            marks[spec.name] = measured_marks
    return {"measured": marks} if marks else {}


def _look(kind: bool | None, colour: Any) -> dict[str, Any]:
    """The look of a point: a limit is a diamond, a wall that was tried is a disc if it was
    stable, otherwise a ring."""
    if kind is False:
        return _POINT | _HOLLOW | {"color": colour}
    return _POINT | _EDGE | {"color": colour, "marker": "D" if kind is None else "o"}


@dataclass(frozen=True)
class WallMarks:
    """Measured walls in a plane of damping and stiffness.

    of: the walls of a spec, `(2, points)`: damping and stiffness, by whether they were stable
    (None: limits); and a colour.
    """

    of: Sequence[tuple[ByKind, Any]]

    @property
    def colour(self) -> Any:
        """That of the entries of a legend: of the only spec, or grey for several."""
        colours = [colour for _, colour in self.of]
        return colours[0] if len(colours) == 1 else "0.4"

    def highest(self, limit: float) -> float:
        """The largest stiffness up to `limit`, or 0."""
        tried = np.concatenate(
            [np.zeros(1), *(points[1] for walls, _ in self.of for points in walls.values())]
        )
        return float(tried[tried <= limit].max())

    def draw(self, axes: Any) -> None:
        """Draw the walls within the limits of the axes, which have to be set; those on the frame
        are not cut off."""
        for kind, points, colour in (
            (*walls_by_kind, colour) for walls, colour in self.of for walls_by_kind in walls.items()
        ):
            spans = zip(points, (axes.get_xlim(), axes.get_ylim()), strict=True)
            inside = np.all(
                [(coordinate >= low) & (coordinate <= high) for coordinate, (low, high) in spans],
                axis=0,
            )
            if inside.any():
                axes.plot(*points[:, inside], **_look(kind, colour), clip_on=False)

    def handles(self, x: Sequence[float], y: tuple[float, float]) -> list[Any]:
        """The entries of a legend, with the number of points beyond the values x along a figure,
        or its span y."""
        from matplotlib.lines import Line2D

        handles = []
        for kind in dict.fromkeys(kind for walls, _ in self.of for kind in walls):
            points = np.hstack([walls[kind] for walls, _ in self.of if kind in walls])
            outside = sum(
                not (x[0] <= B <= x[-1] and y[0] <= K <= y[1]) for B, K in points.T.tolist()
            )
            said = f" ({outside} of {points.shape[1]} outside)" if outside else ""
            handles.append(Line2D([], [], **_look(kind, self.colour), label=KINDS[kind] + said))
        return handles


def walls(facts: Facts, x: str | None, upward: str, several: bool) -> WallMarks:
    """The walls in a figure with x along it and the number `upward` upwards; of several specs, or
    of the only one."""
    specs = specs_of(facts)
    if not several:
        plane_walls = _walls_in_plane(facts, x, upward)
        return WallMarks([(plane_walls, "black")] if plane_walls else [])
    if x not in [damping_of(tables) or "B_VE" for tables in specs.values()]:
        return WallMarks([])
    colours = _coloured(facts, "z_width", specs)
    return WallMarks([(_walls_by_kind(facts, spec), colour) for spec, colour in colours.items()])


def _walls_by_kind(facts: Facts, spec: str) -> ByKind:
    points = facts.get("measured", {}).get(spec, {}).get("z_width")
    if not points:
        return {}
    walls = np.array([points["B_VE"], points["K_VE"]])
    if "stable" not in points:
        return {None: walls}
    stable = np.array(points["stable"])
    return {kind: walls[:, stable == kind] for kind in (True, False) if (stable == kind).any()}


def _walls_in_plane(facts: Facts, x: str | None, upward: str) -> ByKind:
    """Those of the only spec of a run, if its figure has the wall's damping along it and its
    stiffness upwards."""
    wall = facts.get("spec", {}).get("ports", {}).get("wall")
    if wall is None:
        names = ("B_VE", "K_VE")
    else:
        names = (wall["damping"], wall["stiffness"])
    if (x, upward) not in (names, tuple(SYMBOLS.get(name, name) for name in names)):
        return {}
    return _walls_by_kind(facts, str(facts.get("spec_name", "")))


def undrawn(facts: Facts, x: str | None, upward: str) -> str:
    """A sentence about measured walls that a figure with another plane does not show; empty if
    there are none."""
    if not _walls_by_kind(facts, str(facts.get("spec_name", ""))) or _walls_in_plane(
        facts, x, upward
    ):
        return ""
    return "The measured walls are not shown: they are of stiffness over damping of the wall."


def _coloured(facts: Facts, part: str, specs: Iterable[str]) -> dict[str, Any]:
    """The specs with measured points of a part, "z_width" or "response", and their colours.

    Of those that have the same points there is the first alone, in black.
    """
    colours = {spec: distinct_colour(number) for number, spec in enumerate(specs)}
    same = {}
    for spec in colours:
        if points := facts.get("measured", {}).get(spec, {}).get(part):
            same.setdefault(points["sha256"], []).append(spec)
    alone = len(colours) == 1
    return {
        group[0]: "black" if alone or len(group) > 1 else colours[group[0]]
        for group in same.values()
    }


@dataclass(frozen=True)
class Responses:
    """Measured responses; colours: of the specs that have some."""

    facts: Facts
    colours: Mapping[str, Any]

    def draw(self, axes: Any, name: str) -> np.ndarray:
        """Draw those of a column of admittances, and give their frequencies (Hz), which all
        panels at the hand show."""
        places = [np.zeros(0)]
        for spec, colour in self.colours.items():
            points = self.facts["measured"][spec]["response"]
            H = np.array(points["re"]) + 1j * np.array(points["im"])
            hertz = np.array(points["frequency_hz"])
            if name.startswith("admittance"):
                label = "measured" if colour == "black" else f"{as_it_stands(spec)}, measured"
                if name == "admittance_abs":
                    values = 1e3 * np.abs(H)  # mm/N
                else:
                    values = np.degrees(np.angle(H))
                axes.plot(hertz, values, color=colour, label=label, **_OF_RESPONSE)
            places += [hertz] if name.startswith(("admittance", "impedance")) else []
        return np.concatenate(places)


def responses(facts: Facts, specs: Iterable[str]) -> Responses:
    """The responses of these specs."""
    return Responses(facts, _coloured(facts, "response", specs))
