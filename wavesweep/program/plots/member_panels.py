"""What a panel of stable intervals shows: the members of a family, hands or specs, as curves or
as bars."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from textwrap import fill
from typing import Any

import numpy as np

from wavesweep.program.analyses.claim_words import nothing
from wavesweep.program.analyses.claims import OPERATOR, Claim, Status, of_rows, of_spec
from wavesweep.program.analyses.plane_columns import (
    KNOWN,
    PlaneCurve,
    View,
    columns_of,
    curves_of,
    open_spans,
)
from wavesweep.program.columns import Columns, whose_column
from wavesweep.program.plots.figure_layout import rows_with, where
from wavesweep.program.plots.labels import shortened, valued
from wavesweep.program.plots.style import (
    DOUBTFUL,
    LINES,
    UNKNOWN,
    UNPROVED,
    Look,
    distinct_look,
    family_looks,
    paler,
)
from wavesweep.program.row_kinds import COMPUTED, RowKind, row_kinds

HALF_BAR = 0.32  # of the distance between two bars


@dataclass(frozen=True, eq=False)
class Member:
    """One of the sets of intervals that a panel has: a value of the family, a hand, or a spec.

    name: in a legend, or at a bar. claim: what its rows say. facts: with the spec from which
    columns between its rows are computed. guarantee: the word of a hand, or of [for_all]; empty for
    others.
    """

    name: str
    look: Look
    rows: Columns
    claim: Claim
    facts: Mapping[str, Any]
    guarantee: str = ""

    @property
    def at_values(self) -> bool:
        """Whether its intervals are known at the swept values alone, and nothing can be computed
        between them."""
        return self.guarantee not in ("", *COMPUTED)

    @property
    def proved(self) -> bool:
        """Whether its intervals are what is proved."""
        return self.claim.status is Status.PROVED


def members_of(
    columns: Columns,
    facts: Mapping[str, Any],
    bars: Sequence[Mapping[str, float]],
    specs: Collection[tuple[str, str]],
) -> list[Member]:
    """The members of a panel, whose rows these are.

    bars: the values of the axes of each member of a family. specs: all specs of a comparison with
    the words of their rows, in the order of their looks.
    """
    whose = whose_column(columns)
    if whose == "spec":
        return _members_of_specs(columns, facts, specs)
    if whose:
        return _members_of_hands(columns, facts, columns[whose])
    members = []
    for look, values in zip(family_looks(len(bars)), bars, strict=True):
        if len(values) > 1:
            name = ", ".join(valued(axis, value, facts) for axis, value in values.items())
        else:
            name = "".join(f"{value:g}" for value in values.values())
        claim = of_rows(facts, "")
        members.append(Member(name, look, rows_with(columns, values), claim, facts))
    return members


def _members_of_specs(
    columns: Columns, facts: Mapping[str, Any], specs: Collection[tuple[str, str]]
) -> list[Member]:
    """The specs of a comparison that have rows here."""
    looks = {member: distinct_look(number) for number, member in enumerate(specs)}
    members = []
    for name in dict.fromkeys(name for name, _ in specs):
        rows = where(columns, columns["spec"] == name)
        if not len(rows["spec"]):
            continue
        own = of_spec(facts, name)
        title = shortened(name)
        if set(rows.get("guarantee", ())) <= {"spec"}:
            claim = of_rows(own, "spec")
            members.append(Member(title, looks[name, "spec"], rows, claim, own))
            continue
        for member in _members_of_hands(rows, own, rows["guarantee"]):
            look = looks[name, member.guarantee]
            members.append(replace(member, name=f"{title}: {member.name}", look=look))
    return members


def _members_of_hands(
    columns: Columns, facts: Mapping[str, Any], kinds: np.ndarray
) -> list[Member]:
    """The hands, or the guarantees, that have rows here; kinds: the word of each row."""
    members = []
    for word in dict.fromkeys([*row_kinds(), *sorted(set(kinds.tolist()))]):
        rows = where(columns, kinds == word)
        if not len(rows["along"]):
            continue
        claim = of_rows(facts, word)
        name = row_kinds()[word].legend
        if claim.status is Status.PROVED and not rows["certified"].all():
            name += " (not all certified)"
        elif word not in COMPUTED and claim.scope.hands == OPERATOR and "operator" in kinds:
            name += " (operator)"
        drawn = _as_drawn(rows, claim)
        members.append(Member(name, look_of(row_kinds()[word]), drawn, claim, facts, word))
    return members


def _as_drawn(rows: Columns, claim: Claim) -> Columns:
    """Rows as a figure takes them.

    What is proved for all has an end wherever a counterexample or nothing is known beyond it.
    """
    if claim.status is not Status.PROVED or "fails_from" not in rows:
        return rows
    ends = {
        omega: np.where(np.isfinite(rows[fails]) | ~rows["settled"], 0.0, np.nan)
        for omega, fails in (("low_omega", "fails_below"), ("high_omega", "fails_from"))
    }
    return {**rows, **ends}


def look_of(kind: RowKind) -> Look:
    """The look of the rows of a kind, the same whichever are there."""
    return Look(kind.colour, LINES[kind.line])


def over_one_damping(columns: Columns, facts: Mapping[str, Any]) -> Columns:
    """The columns with the dampings of all walls in that of the first spec which sweeps its own.

    Another spec has its own value there.
    """
    names = {}
    values = {}
    for spec, tables in specs_of(facts).items():
        damping = damping_of(tables)
        if damping:
            names[spec] = damping
            values[spec] = tables["numbers"][damping]["value"]
        else:
            names[spec] = "B_VE"
            values[spec] = tables.get("environment", {}).get("B_VE", np.nan)
    x = next((name for name in names.values() if name in columns), None)
    if x is None or set(names.values()) == {x}:
        return columns
    merged = columns[x].astype(float)
    for spec, name in names.items():
        rows = (columns["spec"] == spec) & np.isnan(merged)
        merged[rows] = columns[name][rows] if name in columns else values[spec]
    others = set(names.values()) - {x}
    unchanged = {name: column for name, column in columns.items() if name not in others}
    return unchanged | {x: merged}


def damping_of(tables: Mapping[str, Any]) -> str | None:
    """The number of a drawn loop that is the damping of its wall."""
    return tables.get("ports", {}).get("wall", {}).get("damping")


def specs_of(facts: Mapping[str, Any]) -> Mapping[str, Mapping[str, Any]]:
    """The tables of all specs of a comparison, by their names."""
    return facts.get("specs") or {facts.get("spec_name", ""): facts.get("spec", {})}


def member_curves(
    members: Sequence[Member], view: View, span: tuple[float, float]
) -> list[PlaneCurve]:
    """The curves of all members; those of one family in a batch."""
    of_one_spec = len({id(member.facts) for member in members}) == 1
    if of_one_spec and not any(member.guarantee for member in members):
        return curves_of([member.rows for member in members], view, members[0].facts)
    dampings = {damping_of(member.facts.get("spec", {})) for member in members}
    over_damping = view.x == "B_VE" or view.x in dampings
    curves = []
    for member in members:
        rows = member.rows
        x = rows[view.x]
        if member.at_values:
            curves.append(PlaneCurve(columns_of(rows, x)))
        elif np.isnan(x).all():  # a loop that does not read it has the same intervals everywhere
            (column,) = columns_of(rows, np.zeros(len(x))).values()
            curves.append(PlaneCurve(dict.fromkeys(span, column), {span: KNOWN}))
        elif over_damping:  # of its wall, for which its spec may have another name than the figure
            damping = damping_of(member.facts.get("spec", {})) or "B_VE"
            renamed = {name: column for name, column in rows.items() if name != view.x}
            renamed[damping] = x
            curves += curves_of([renamed], replace(view, x=damping), member.facts)
        else:
            curves += curves_of([rows], view, member.facts)
    return curves


def _draw_stable_bar(axes: Any, place: int, row: Mapping[str, Any], colour: Any) -> None:
    """Draw the bar of a stable interval, with strokes at the ends that are ends of the stable
    set."""
    low = row["low"]
    high = row["high"]
    if row["certified"]:
        area = {"facecolor": paler(colour, 0.25), "linewidth": 0}
        edge = {"colors": colour, "linestyles": "-"}
    else:
        area = {**UNPROVED, "edgecolor": colour}
        edge = {"colors": DOUBTFUL, "linestyles": "--"}
    axes.barh(place, high - low, left=low, height=2 * HALF_BAR, **area)
    ends = [row[end] for end in ("low", "high") if not np.isnan(row[f"{end}_omega"])]
    if ends:
        axes.vlines(ends, place - HALF_BAR, place + HALF_BAR, **edge)


def bar_names(members: Sequence[Member], width: float) -> list[str]:
    """The names at the left of bars, in lines that take a third of a figure of this width,
    inches."""
    letters = int(4.6 * width)
    return [fill(member.name, letters) for member in members]


def draw_bars(axes: Any, members: Sequence[Member]) -> None:
    """Draw a bar per stable interval, a line of bars per member, named at the left.

    An end of the stable set is marked by a stroke; if the swept range ends the bar, there is none.
    """
    family = family_looks(1)[0].colour
    for place, member in enumerate(members):
        rows = member.rows
        colour = member.look.colour if member.guarantee or "spec" in rows else family
        unknown = list(chain.from_iterable(open_spans(rows)))
        # draw what is not known in a line of bars, over the whole width if nothing is
        for low, high in unknown:
            if np.isinf(low):
                axes.axhspan(place - HALF_BAR, place + HALF_BAR, **UNKNOWN)
            else:
                axes.barh(
                    place, high - low, left=low, height=2 * HALF_BAR, **UNKNOWN | {"zorder": 3}
                )
        stable = np.flatnonzero(rows["intervals"] > 0)
        if not stable.size:
            certain = bool(rows["certified"].all()) if member.proved else not unknown
            said = nothing(member.claim, certain=certain)
            offset = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
            axes.annotate(said, (0, place), (3, 0), **offset, va="center", color="0.35")
        for row in stable.tolist():
            _draw_stable_bar(axes, place, where(rows, row), colour)
    names = bar_names(members, axes.figure.get_figwidth())
    if any(names):
        axes.set_yticks(range(len(names)), names)
    else:
        axes.set_yticks([], [])
    axes.set_ylim(-0.6, max(len(members) - 0.4, 0.6))
