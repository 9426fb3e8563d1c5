"""The value of designs: objectives, violations of bounds, and the nearest miss if no design meets them all."""

from collections.abc import Mapping, Sequence

import numpy as np

from wavesweep.search.family import Scenario, described
from wavesweep.spec import Spec
from wavesweep.spec.design import Design

MOST = 10.0  # what the violation of one bound counts at most, as a share of it; values that are not known count more than all
LEAST = 1e-9  # of a quantity of which the logarithm is an objective
BY_RATIO = ("z_width", "felt")  # quantities that count by their ratios


def judged(design: Design, records: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return objectives to be made small, `(designs, objectives)`, and violations, `(designs,)`.

    A violation is 0 if all bounds are kept and all values are certified; a design with fewer values that are missing or not
    certified has the smaller one. Without a free wish the objective is the smallest margin with its sign reversed.
    """
    free = [wish for wish in design.wishes if wish.bound is None]
    bounded = [wish for wish in design.wishes if wish.bound is not None]
    objectives, violation = (
        [_objective(wish, records[wish.name]) for wish in free],
        np.zeros(len(records[design.wishes[0].name])),
    )
    margins = []
    for wish in bounded:
        kept = wish.margin(records[wish.name])
        margins.append(np.where(np.isnan(kept), -np.inf, kept))
        by = np.maximum(-kept, 0.0)
        violation += np.where(np.isnan(by), MOST, MOST * by / (MOST + by))
    for wish in design.wishes:
        unknown = _missing(wish, records) | ~records[f"{wish.name}_certified"]
        violation += np.where(unknown, MOST * len(design.wishes), 0.0)
    if not free:
        objectives = [-np.min(margins, axis=0)]
    return np.stack(objectives, axis=1), violation


def _missing(wish, records):
    """Where there is no value; a design that can render no wall is none."""
    value = records[wish.name]
    return np.isnan(value) | ((value <= 0) & (wish.name in BY_RATIO))


def _objective(wish, value):
    value = np.log(np.maximum(value, LEAST)) if wish.name in BY_RATIO else value
    return np.where(np.isnan(value), np.inf, -value if wish.kind.more else value)


def miss(spec: Spec, records: np.ndarray, scenarios: Sequence[Scenario], units: Mapping[str, str]) -> str:
    """Return a text on the nearest miss and on the wishes that conflict with each other; units: of the wishes."""
    design = spec.design
    _, violation = judged(design, records)
    at = int(np.argmin(violation))
    parts = []
    for wish in design.wishes:
        value = records[wish.name][at]
        said = "not known" if np.isnan(value) else f"{value:.6g} {units[wish.name]}".removesuffix(" 1").rstrip()
        if wish.bound is not None:
            said += f" ({wish.kind.bound.replace('_', ' ')} {wish.bound:g})"
        if not (np.isnan(value) or records[f"{wish.name}_certified"][at]):
            said += ", not certified"
        place = described(scenarios, int(records[f"{wish.name}_scenario"][at]))
        parts.append(f"{wish.name} {said}{f' with {place}' if place and wish.bound is not None else ''}")
    against = _against(design, records)
    bounded = any(wish.bound is not None for wish in design.wishes)
    missing = any(bool(_missing(wish, records)[at]) for wish in design.wishes)
    wanted = "meets all bounds" if bounded else f"has a {'' if missing else 'certified '}value for every wish"
    loop = "that is unstable or not proved for all of [for_all]" if spec.for_all else "that is unstable"
    why = f"; a loop {loop} has no value, and `wavesweep check` says which numbers make it so" if missing else ""
    return f"no design of {len(records)} {wanted}; the nearest has {'; '.join(parts)}{against}{why}"


def _against(design, records):
    """Return a text on the first pair of bounds that each were met by some designs but never by the same one.

    If there is no such pair, the text names the bounds that no design met; it is empty if there are none.
    """
    kept = {wish.name: wish.margin(records[wish.name]) >= 0 for wish in design.wishes if wish.bound is not None}
    names = list(kept)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if kept[one].any() and kept[other].any() and not (kept[one] & kept[other]).any():
                counts = f"{kept[one].sum()} designs met the one, {kept[other].sum()} the other, none both"
                return f"; {one} stands against {other}: {counts}"
    never = [name for name, flags in kept.items() if not flags.any()]
    return f"; never met by itself: {', '.join(never)}" if never else ""
