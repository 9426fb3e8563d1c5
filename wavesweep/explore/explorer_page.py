"""The page of a spec: its text with the data in it, the answers to its questions, and the file
that needs no server."""

import base64
import hashlib
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from functools import reduce
from html import escape
from importlib.resources import files
from itertools import product
from math import prod
from operator import or_
from types import MappingProxyType

import numpy as np

from wavesweep.capabilities import asked
from wavesweep.engine.errors import SpecError, WavesweepError
from wavesweep.explore.answers import (
    Plane,
    certified_plane,
    first_plane,
    fitted,
    is_gain,
    preview,
    quick,
    span_of,
    stable_ranges,
)
from wavesweep.explore.limited_time import within
from wavesweep.explore.server import Answer, as_json
from wavesweep.explore.sliders import changed, number_of, sliders_of, taken, text_of
from wavesweep.haptics.controllers import WALL
from wavesweep.program.analyses.claim_words import form_of, scope_in_words
from wavesweep.program.analyses.claims import asks_more, questions
from wavesweep.program.plots.figure_marks import facts_of_marks
from wavesweep.program.reading.keys import readable
from wavesweep.program.spec import Spec

FIRST_CELLS, LEAST_CELLS, MOST_CELLS = 16, 10, 40  # of a preview along an axis
SCRIPTS = ("state.js", "asking.js", "drawing.js", "loop.js", "controls.js", "report.js")
MOST_DESIGNS = 64  # of a sweep that a saved page has
MOST_OF_PLANE = 100  # the same if numbers of the axes of its plane have sliders too
NOTHING = MappingProxyType(
    {"measured": {}, "cuts": [], "routes": []}
)  # that capabilities show in addition


class Page:
    """The page of a spec, which answers the questions of its script."""

    def __init__(self, spec: Spec, answer_s: float = 2.0) -> None:  # s
        self.spec, self.answer_s = spec, answer_s
        self.sliders = sliders_of(spec)
        self.plane = first_plane(spec, self.sliders)
        self.shown = reduce(or_, asked("panel", "data", spec), dict(NOTHING))
        self._cells, self._by_gain = FIRST_CELLS, {}
        search = {slider.path: slider.search for slider in self.sliders if slider.path in WALL}
        self.first = quick(spec)
        with suppress(WavesweepError):  # somewhere in the plane there is no loop
            self.first |= self._preview(spec, self.plane, search) if self.plane else {}
        self.by_cells = self.first.get("plane", {}).get("how") == "cells"
        if (
            self.by_cells
        ):  # a page opens with the proved plane, if this takes no longer than an answer
            with suppress(WavesweepError, TimeoutError):
                self.first["plane"] = within(answer_s, lambda: certified_plane(spec, self.plane))

    def text(self) -> str:
        """The page with the numbers of the spec's own design, before any question."""
        return page_text(self._data())

    @property
    def answers(self) -> Mapping[str, Answer]:
        """The questions of the page."""
        answers = {
            "quick": self._quick,
            "certified": self._certified,
            "fit": self._fit,
            "toml": self._toml,
        }
        for of_panel in asked("panel", "answers"):
            answers |= {name: self._of_panel(answer) for name, answer in of_panel.items()}
        return {name: self._said(answer) for name, answer in answers.items()}

    def _data(self) -> dict:
        from wavesweep import __version__

        spec = self.spec
        asked = questions(spec) if asks_more(spec) else []
        return {
            "name": spec.name,
            "kind": spec.kind,
            "asked": [
                f"{form_of(each.what).question} {scope_in_words(each.scope)}".strip()
                for each in asked
            ],
            "version": __version__,
            "sliders": [{**asdict(slider), "unit": _unit(slider.unit)} for slider in self.sliders],
            "plane": asdict(self.plane) if self.plane else None,
            "slow": self.by_cells,
            "hand": self.first["response"] is not None,
            "units": {
                "felt": [_unit(spec.at_port(unit)) for unit in ("N/m", "N*s/m")],
                "admittance": _unit(spec.at_port("m/N")),
                "impedance": _unit(spec.at_port("N/m")),
            },
            "first": self.first,
            **self.shown,
        }

    def _said(self, answer):
        """The function with errors about a design as part of its answer, and the keys or fields
        that they are about.

        What takes too long is cut.
        """

        def answered(question):
            try:
                return within(self.answer_s, lambda: answer(question))
            except TimeoutError:
                return {"error": f"takes longer than {self.answer_s:g} s", "cut": True}
            except SpecError as error:
                mistakes = "; ".join(
                    str(mistake._replace(location="")) for mistake in error.mistakes
                )
                at = getattr(error, "at", [mistake.key for mistake in error.mistakes])
                return {"error": _sentence(mistakes), "at": at}
            except WavesweepError as error:
                return {"error": _sentence(str(error))}
            except (np.linalg.LinAlgError, FloatingPointError, OverflowError) as error:
                return {"error": f"numbers beyond double precision ({error})"}

        return answered

    def _quick(self, question):
        spec = self._changed(question)
        plane = self._plane(spec, question["plane"]) if question.get("plane") else None
        search = {
            path: span_of(span) for path, span in question.get("search", {}).items() if path in WALL
        }
        started = time.perf_counter()
        answer = quick(spec, bool(question.get("response", True)))
        # Beside numbers that take long the plane and the intervals follow when the sliders rest.
        if plane and time.perf_counter() - started < self.answer_s / 4:
            answer |= self._preview(spec, plane, search, bool(question.get("preview", True)))
        return reduce(
            or_,
            asked("panel", "quick", spec, question, self.shown, answer["own"]["stable"]),
            answer,
        )

    def _preview(self, spec, plane, search, wanted=True):
        """The fastest preview of a plane, with as many cells as the one before shows that there
        is time for."""
        if plane.y not in self._by_gain:
            self._by_gain[plane.y] = is_gain(spec, plane)
        started = time.perf_counter()
        cells = preview(spec, plane, self._cells if wanted else 0, search, self._by_gain[plane.y])
        if cells.get("plane", {}).get("how") == "cells":
            # Seconds that a preview by cells may take.
            factor = (0.02 / (time.perf_counter() - started)) ** 0.5
            self._cells = int(np.clip(self._cells * factor, LEAST_CELLS, MOST_CELLS))
        return cells

    def _of_panel(self, answer):
        """A question to a capability, about the design that the page asks for."""
        return lambda question: answer(self._changed(question), question, self.shown)

    def _certified(self, question):
        spec = self._changed(question)
        if "along" in question:
            path, span = self._smooth(question["along"]), span_of(question["span"])
            low, high = (taken(spec, path, number_of(spec, path), end) for end in span)
            return stable_ranges(spec, path, (low, high))
        return certified_plane(spec, self._plane(spec, question["plane"]))

    def _fit(self, question):
        spec = self._changed(question)
        x, y = (self._smooth(question[name]) for name in ("x", "y"))
        sliders = {slider.path: slider for slider in sliders_of(spec)}
        return {
            "plane": asdict(
                # The range that is searched for a limit, if the axes are to show one.
                fitted(spec, sliders, x, y, (sliders[x].low, sliders[x].high), 64.0)
            )
        }

    def _plane(self, spec, given):
        """A plane whose corners are designs. Errors: SpecError `at` the field of another end,
        KeyError for other keys."""
        plane = Plane.of(given)
        for axis, path, span in (("x", plane.x, plane.x_span), ("y", plane.y, plane.y_span)):
            for end, value in enumerate(span):
                try:
                    changed(spec, {self._smooth(path): value})
                except SpecError as error:
                    error.at = [f"{axis}{end}"]
                    raise
        return plane

    def _toml(self, question):
        return {"text": text_of(self._changed(question))}

    def _smooth(self, path):
        if path not in [slider.path for slider in self.sliders if slider.search]:
            raise KeyError(path)
        return path

    def _changed(self, question):
        slider_paths = {slider.path for slider in self.sliders}
        values = question["values"]
        if not isinstance(values, dict) or not set(values) <= slider_paths:
            raise KeyError("values")
        if not all(isinstance(value, (int, float)) for value in values.values()):
            raise TypeError("values")
        return changed(self.spec, values)


def _unit(unit):
    """A unit as people write it."""
    return readable(unit).replace("*", "·").replace("^2", "²").replace("^3", "³")


def _sentence(error: str) -> str:
    """The mistakes of a spec in one line."""
    return " ".join(error.split())


def saved_page(spec: Spec, progress: Callable[[int, int], None] | None = None) -> str:
    """The page with the results of the spec's sweep in it: figures, table, spec and facts. It asks
    no server.

    progress: a function of (done, total), the designs and tables of the page.

    Each number of the sweep has a slider, whose places are values of the sweep, up to MOST_DESIGNS
    designs.
    """
    page, report = Page(spec), progress or (lambda *_: None)
    data = page._data()  # noqa: SLF001 - the same page
    stops, left = _stops(page)
    combinations = list(product(*stops.values()))
    designs = []
    planes = {}
    ranges = {}
    total = len(combinations) + len(TABLES)
    for done, values in enumerate(combinations):
        report(done, total)
        with suppress(
            WavesweepError
        ):  # a combination that makes no loop, such as a delay beyond the frame
            design = _design(page, dict(zip(stops, values, strict=True)), planes, ranges)
            designs.append(design)
    data["first"], tables = None, []
    for done, (title, make) in enumerate(TABLES.items(), len(combinations)):
        report(done, total)
        try:
            table = make(spec)
            tables.append(
                _table(
                    title,
                    replace(table, facts={**table.facts, **facts_of_marks([spec], table.kind)}),
                )
            )
        except WavesweepError as error:
            text = str(error).replace(
                str(spec.source), f"{spec.name}.toml"
            )  # the page leaves its folder
            tables.append({"title": title, "error": _sentence(text)})
    report(total, total)
    saved = {"designs": designs, "planes": [*planes.values()], "stops": stops, "left": left}
    return page_text(data | saved | {"report": tables})


def _stops(page):
    """The places of the sliders of a saved page by path, and how many designs are left out since
    they are too many.

    Numbers beside the plane have all of their values. Those of its axes share what is left of
    MOST_OF_PLANE: some of their values or, of a range, places between its ends, and always the
    spec's own.
    """
    plane = (page.plane.x, page.plane.y) if page.plane else ()
    axes = {axis.path: axis for axis in page.spec.sweep}
    stops = {}
    for slider in page.sliders:
        if slider.values and slider.path not in plane:
            stops[slider.path] = sorted({*slider.values, float(slider.value)})
    count = prod(map(len, stops.values()))
    if count > MOST_DESIGNS:
        return {}, count
    swept = [slider for slider in page.sliders if slider.path in plane and slider.path in axes]
    # and the own value
    # Room for a root that is a whole number, but for rounding.
    each = int((MOST_OF_PLANE / count) ** (1 / max(1, len(swept))) + 1e-9) - 1
    if each < 2:  # beside its own value; with fewer it has no slider
        return stops, 0
    for slider in swept:
        values = slider.values or _places_between(slider, axes[slider.path], each)
        count = min(each, len(values))
        chosen = np.unique(np.linspace(0, len(values) - 1, count).round().astype(int))
        stops[slider.path] = sorted({*(values[at] for at in chosen), float(slider.value)})
    return stops, 0


def _places_between(slider, axis, count):
    """Values between the ends of an axis of a sweep as far as its slider goes, rounded."""
    spaced = np.geomspace if axis.scale == "log" else np.linspace
    low = max(axis.start, slider.low)
    high = min(axis.stop, slider.high)
    return [float(f"{value:.6g}") for value in spaced(low, high, count)]


def _design(page, values, planes, ranges):
    """The answers about a design. planes: those of earlier designs, by the numbers beside their
    axes; ranges: their stable intervals, by the number along which they are and those beside it."""
    spec, plane = changed(page.spec, values), page.plane
    answer = quick(spec) | {"values": values, "toml": text_of(spec)}
    search = {slider.path: slider.search for slider in page.sliders}
    if plane:
        beside = tuple(item for item in values.items() if item[0] not in (plane.x, plane.y))
        if beside not in planes:
            planes[beside] = certified_plane(spec, plane)
        answer["plane"] = [*planes].index(beside)
    if plane:
        along = [plane.x, plane.y]
    else:
        along = [path for path, span in search.items() if span][:1]
    answer["ranges"] = []
    for path in along:
        beside = path, tuple(item for item in values.items() if item[0] != path)
        if beside not in ranges:
            ranges[beside] = stable_ranges(spec, path, search[path])
        answer["ranges"].append(ranges[beside])
    return answer


def _intervals(spec):
    from wavesweep.program.tables.interval_table import intervals

    return intervals(spec, spec.along or None)


def _responses(spec):
    from wavesweep.program.tables.response_table import responses

    return responses([spec])


TABLES = {"Stable intervals": _intervals, "Responses": _responses}


def _table(title, table):
    from wavesweep.program import results
    from wavesweep.program.plots import drawn

    table = drawn(table)
    csv, figure = results.pictured(table)
    lines = csv.decode().rstrip("\n").split("\n")
    fields = results.fields_of(table.kind, next(iter(table.blocks())), table.facts)
    return {
        "title": title,
        "kind": table.kind,
        "units": [field.unit for field in fields],
        "csv": "\n".join(lines[:5001]),  # with a heading
        "rows": len(lines) - 1,
        "facts": {
            name: fact for name, fact in table.facts.items() if name != "timings"
        },  # equal pages of equal specs
        "figure": f"data:image/svg+xml;base64,{base64.b64encode(figure.encode()).decode()}",
    }


def page_text(data: Mapping[str, object]) -> str:
    """The text of a page with data in it; a policy in it lets its own script run, and nothing be
    fetched from elsewhere."""
    page, style, *scripts = (
        (files(__package__) / name).read_text(encoding="utf-8")
        for name in ("page.html", "page.css", *SCRIPTS)
    )
    script = "".join(scripts)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; img-src data:; connect-src 'self'; "
    policy += "base-uri 'none'; form-action 'none'"
    inside = as_json(data).replace("<", "\\u003c")
    page = page.replace("{{style}}", style)
    page = page.replace("{{script}}", script)
    page = page.replace("{{policy}}", policy)
    page = page.replace("{{title}}", escape(str(data["name"])))
    return page.replace("{{data}}", inside)
