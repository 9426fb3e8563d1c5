"""For a page of `explore`, how a drawn loop without a hand behaves: its step response, L of the
loop broken at a signal, and the margins of that.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from wavesweep.engine.doubts import words
from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.engine.response import Step
from wavesweep.margins.broken_loops import broken_at, cuts_of, lines_at
from wavesweep.margins.dead_time_margin import in_seconds
from wavesweep.margins.figure import decibels_and_degrees, marks_of, response_of
from wavesweep.margins.lifted_margins import margins_of
from wavesweep.margins.table import UNITS
from wavesweep.program.analyses.steps import routes_of, step_at, step_between
from wavesweep.program.columns import RATIO
from wavesweep.program.plots.sampling import extremes
from wavesweep.program.spec import Spec

FIRST_POINTS = 90  # points to begin with
MOST_TIMES = 16  # that a signal is made in a frame, beyond which its margins may take seconds
MOST_STEP_STATES = 1_000_000  # samples of a step response times states


Shown = Mapping[str, Any]  # what a page has, with `cuts` and `routes`


def data(spec: Spec) -> dict[str, list]:
    """The signals at which a drawn loop without a hand can be broken, and its pairs of an input
    and an output."""
    if not spec.drawing or spec.drawing.hand:
        return {"cuts": [], "routes": []}
    often = {}
    for cut in cuts_of(spec):
        with suppress(WavesweepError):  # it does not come back to itself
            often[cut] = broken_at(spec, cut).times > MOST_TIMES
    # A page begins with the first one, and waits for its margins.
    return {"cuts": sorted(often, key=often.__getitem__), "routes": routes_of(spec)}


def _chosen(question: Mapping[str, Any], shown: Shown) -> tuple[str, list[str] | None]:
    """The signal at which the loop is broken, and the input and the output of a step, if there
    are any."""
    cut, route = question["cut"], question.get("route")
    if cut not in shown["cuts"] or (route and tuple(route) not in shown["routes"]):
        raise KeyError(cut)
    return cut, route


def quick(spec: Spec, question: Mapping[str, Any], shown: Shown, stable: bool) -> dict:
    """L over frequency, and the response to a step: of an input of the route that is asked for, or
    without one of the loop closed at the cut; nothing without a cut.

    L is exact up to rounding at its points. The step response has bounds on its errors and on what
    comes after it, so that its numbers are proved. If the loop is not `stable`, or does not come to
    rest, it has an `error` in place of these.
    """
    if not question.get("cut"):
        return {}
    cut, route = _chosen(question, shown)
    loop = broken_at(spec, cut)
    # Change of ln L between two points of a curve.
    hertz, L = response_of(loop, 0.2, FIRST_POINTS, FIRST_POINTS)
    decibels, degrees = decibels_and_degrees(L, loop.times > 1)
    curves = {"hertz": hertz, "re": L.real, "im": L.imag, "decibels": decibels, "degrees": degrees}
    curve = {name: values.tolist() for name, values in curves.items()} | {
        "several": loop.times > 1,
        "cut": cut,
    }
    if not stable:
        return {"open": curve, "step": {"error": "the loop is unstable, and nothing comes to rest"}}
    try:
        if route:
            step = step_between(spec, (route[0], route[1]), MOST_STEP_STATES)
        else:
            step = step_at(spec, cut, MOST_STEP_STATES)
    except UsageError:
        return {"open": curve, "step": {"error": "it does not come to rest, or too slowly to tell"}}
    unit = spec.unit_between(*route) if route else RATIO
    return {"open": curve, "step": _numbers(step, 1.0 if route else -1.0) | {"unit": unit}}


def _numbers(step: Step, sign: float) -> dict:
    """The samples that are worth showing, and what is read from them; sign: of the values."""
    # Of a step response that are sent.
    times, values = extremes(step.time_s[: step.shown], step.value[: step.shown], 600)
    first, second = step.rise_s
    return {
        "time_s": times.tolist(),
        "value": (sign * values).tolist(),
        "final": sign * step.final,
        "rise": [[time, sign * step.value_at(time)] for time in (first, second)]
        if second > 0
        else [],
        "rise_s": second - first,
        "peak": [step.peak_s, sign * step.value_at(step.peak_s)],
        "known": bool(step.known),
        "overshoot": step.overshoot,
        "settling_s": step.settling_s,
        "error": None,
    }


def _margins(spec: Spec, question: Mapping[str, Any], shown: Shown) -> dict:
    """The margins of the loop that is broken at a signal, as the table has them, with L where
    each is set."""
    cut, _ = _chosen(question, shown)
    loop = broken_at(spec, cut)
    margins, doubt = margins_of(loop)
    margins = in_seconds(spec, cut, margins, loop.times)
    marks = marks_of(loop, {margin.name: (margin.value, margin.omega) for margin in margins})
    doubts = words([margin.doubt for margin in margins])
    lines = lines_at(loop, margins)
    rows = []
    for margin, word, line in zip(margins, doubts, lines, strict=True):
        mark = marks.get(margin.name)
        rows.append(
            {
                "name": margin.name,
                "value": margin.value,
                "unit": UNITS.get(margin.name, RATIO),
                "hz": margin.omega / (2 * np.pi),
                "line_hz": line,
                "doubt": word,
                "limited": margin.limited,
                "at": None if mark is None else [mark.real, mark.imag],
            }
        )
    return {"margins": rows, "cut": cut, "doubt": str(words([doubt])[0])}


def answers() -> Mapping[str, Callable]:
    """The question of a page that takes longer."""
    return {"margins": _margins}
