"""The question of a spec in a sentence, its stable intervals as rows of texts, and what makes
the loop unstable beyond them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.errors import SpecError, WavesweepError
from wavesweep.program.analyses.claim_words import doubted_as, scope_in_words, vouched_for
from wavesweep.program.analyses.claims import Claim, Question, Status, of_rows, questions
from wavesweep.program.columns import Columns, axes_of, open_places, whose_column
from wavesweep.program.number_words import in_all_digits, lasting, rounded_down, rounded_up
from wavesweep.program.row_kinds import row_kinds
from wavesweep.program.spec import sweep_axes
from wavesweep.program.tables.columns import fields_of
from wavesweep.program.tables.interval_sentences import open_in_words
from wavesweep.program.tables.refuters import Refuters

if TYPE_CHECKING:
    from wavesweep.program.spec import Axis, Spec
    from wavesweep.program.tables.table import Table

# of a table of intervals that a report shows; of a longer one the rows with the largest and the
# least end
MOST_REPORT_ROWS = 24
# of an end, how far beyond it the loop is looked at, and in how many digits that is a number: there
# may be another interval next to it
BEYOND = ((1e-3, 6), (1e-6, 9), (1e-9, 12))
HEADS = {
    "guarantee": "for",
    "hand": "for",
    "high": "to",
    "low_hz": "lower limit oscillates at",
    "high_hz": "upper limit oscillates at",
    "low_set_by": "lower limit set by",
    "high_set_by": "upper limit set by",
    "fails_below": "refuted below",
    "fails_from": "refuted from",
}
CLAUSES = {  # of the forms of properties
    "adjective": "is the loop {}",
    "requirement": "is {}",
    "motions": "does every motion come to rest",
}
OWN = ("", "spec", "operator")  # whose rows are those of the spec's own loop


def question(spec: Spec) -> str:
    """What a spec asks of its loops, along the axis of its [sweep]; without one, that of `check`."""
    asked = "; and ".join(map(_clause, questions(spec)))
    try:
        along, other_axes = sweep_axes(spec)
    except WavesweepError:  # a drawn loop without an axis to look along
        return f"{asked[:1].upper()}{asked[1:]}, and how far may each of its numbers go?"
    text = f"For which {along.name} from {in_all_digits(along.start)} to {in_all_digits(along.stop)}{_unit(spec, along)}"
    single = []
    several = []
    for axis in other_axes:
        values = _values(spec, axis)
        if len(axis.values) == 1:
            single.append(values)
        else:
            several.append(values)
    if single:
        text += f", at {' and '.join(single)},"
    if several:
        text += f", for each of {' and of '.join(several)},"
    return f"{text} {asked}?"


def _clause(asked: Question) -> str:
    """What is asked of which loops, with chances, contact and all that varies."""
    what, scope = asked
    return f"{CLAUSES[what.form].format(what.words)} {scope_in_words(scope, whole=True)}".rstrip()


def _values(spec: Spec, axis: Axis) -> str:
    unit = _unit(spec, axis)
    # Values of an axis that are named one by one.
    if len(axis.values) > 6:
        return f"{len(axis.values)} {axis.name} from {min(axis.values):g} to {max(axis.values):g}{unit}"
    return f"{axis.name} = {', '.join(f'{value:g}' for value in axis.values)}{unit}"


def _unit(spec: Spec, axis: Axis) -> str:
    unit = spec.names.keys[axis.path].unit
    return "" if unit in ("", "1") else f" {unit}"


def words_of_spec(spec: Spec) -> str:
    """The first paragraph of the comment that a spec begins with; empty without one."""
    words: list[str] = []
    for line in spec.source_place.text.splitlines():
        text = line.strip()
        if not text.startswith("#") or not text.strip("# "):
            if words or text:
                break
            continue
        words.append(text.lstrip("# ").strip())
    return " ".join(words)


def interval_rows(table: Table) -> tuple[tuple[str, ...], list[list[str]]] | None:
    """The head and the rows of a short table of intervals as texts; None of a long one."""
    columns = table.columns
    if len(columns["along"]) > MOST_REPORT_ROWS:
        return None
    whose = whose_column(columns)
    shown = list(axes_of(columns))
    if whose:
        shown.append(whose)
    shown += ["low", "high", "low_hz", "high_hz"]
    shown += [name for name in ("low_set_by", "high_set_by") if name in columns]
    shown += [
        name
        for name in ("fails_below", "fails_from")
        if name in columns and not np.isnan(columns[name]).all()
    ]
    units = {field.name: field.unit for field in fields_of(table.kind, columns, table.facts)}
    titles = {**HEADS, "low": f"{columns['along'][0]} from"}
    head = []
    for name in shown:
        title = titles.get(name, name)
        unit = units.get(name, "1")
        head.append(title if unit in ("", "1") else f"{title} ({unit})")
    rows = []
    for row in _rows(columns):
        texts = {name: _text(name, row[name]) for name in shown}
        if whose:
            texts[whose] = row_kinds()[row[whose]].legend
        if not row["intervals"]:
            texts["low"] = "none"
        word = row[whose] if whose else ""
        claim = of_rows(table.facts, word)
        rows.append([*texts.values(), _proof(row, claim)])
    return (*head, "proof"), rows


def claims_of_rows(spec: Spec, table: Table) -> Iterator[Claim]:
    """Yield what the certified rows of a table that the spec's own numbers lie in say of all that
    they hold for."""
    columns = table.columns
    if whose_column(columns) != "guarantee" or not len(columns["along"]):
        return
    value = spec.values[spec.names.find(columns["along"][0]).path]
    for row in _rows(columns):
        own = all(row[name] == spec.values[spec.names.find(name).path] for name in axes_of(columns))
        if own and row["certified"] and row["low"] <= value <= row["high"]:
            yield of_rows(table.facts, row["guarantee"])


def _proof(row: Columns, claim: Claim) -> str:
    """Whether a row is certified or proved."""
    if row["certified"]:
        return "proved" if claim.status is Status.PROVED else vouched_for(claim)
    reason = row["doubt"]
    places = open_places({name: [value] for name, value in row.items()}, 0)
    if places:
        reason = f"{reason}, {open_in_words(places)}"
    return f"{doubted_as(claim)}: {reason}"


def counterexamples(spec: Spec, table: Table) -> list[list[str]]:
    """What refutes values beyond the ends of intervals: the other numbers, the value, and the
    eigenvalue, frames or hand.

    An end that the swept range sets has none. Eigenvalues are those of the frame just beyond the
    end, in double precision.
    """
    rows_found = []
    for row in _telling(table.columns):
        axes = {name: row[name] for name in axes_of(table.columns) if not np.isnan(row[name])}
        whose = row.get(whose_column(row), "")
        places = [f"{name} = {value:g}" for name, value in axes.items()]
        if whose:
            places.append(row_kinds()[whose].legend)
        at = ", ".join(places)
        along = row["along"]
        for end, side, fails in (("low", -1.0, "fails_below"), ("high", 1.0, "fails_from")):
            if whose in OWN and not np.isnan(row[f"{end}_omega"]):
                for value, eigenvalue in _beyond(spec, along, axes, row[end], side):
                    rows_found.append([at, value, eigenvalue])
            elif not np.isnan(row.get(fails, np.nan)):
                refuters = Refuters.read(row["counterexample"])
                if end == "high":
                    rows_found.append([at, f"{along} = {rounded_up(row[fails])}", refuters.high])
                else:
                    rows_found.append([at, f"{along} = {rounded_down(row[fails])}", refuters.low])
            elif not np.isnan(row.get(f"{end}_hand_mass", np.nan)):
                mass = row[f"{end}_hand_mass"]
                damping = row[f"{end}_hand_damping"]
                stiffness = row[f"{end}_hand_stiffness"]
                hand = (
                    f"a hand of {in_all_digits(mass)} kg, {in_all_digits(damping)} N*s/m "
                    f"and {in_all_digits(stiffness)} N/m"
                )
                beyond = rounded_up(row[end]) if end == "high" else rounded_down(row[end])
                rows_found.append([at, f"{along} beyond {beyond}", hand])
    return rows_found


def _beyond(
    spec: Spec, along: str, axes: dict[str, float], end: float, side: float
) -> Iterator[list[str]]:
    """Yield the value next to an end with which the loop is unstable, and the eigenvalue that
    makes it so."""
    from wavesweep.program.analyses.poles import poles

    away = rounded_up if side > 0 else rounded_down
    for step, digits in BEYOND:
        value = float(away(end + side * step * abs(end or 1.0), digits))
        try:
            modes = poles(spec.with_values({**axes, along: value}))
        except SpecError:  # beyond what the spec takes, as a stiffness below 0
            return
        worst = int(np.nanargmax(modes["radius"]))
        mode = {name: column[worst] for name, column in modes.items()}
        if mode["radius"] > 1:
            imaginary = abs(mode["z_im"])
            if imaginary:
                z = f"{mode['z_re']:.6g} ± {imaginary:.6g}i"
            else:
                z = f"{mode['z_re']:.6g}"
            size = f"modulus 1 + {mode['radius'] - 1:.3g}"
            hz = mode["shown_hz"]
            motion = f"an oscillation of {hz:.4g} Hz" if hz > 0 else "without oscillation"
            grows = lasting(mode["time_constant_s"])
            yield [
                f"{along} = {in_all_digits(value)}",
                f"eigenvalue {z} per frame, {size}: {motion}, {grows}",
            ]
            return


def _telling(columns: Columns) -> Iterator[dict]:
    """Yield the rows with intervals; of a long table those of the spec's own loop with the
    largest and the least high end."""
    rows = [row for row in _rows(columns) if row["intervals"]]
    if len(rows) <= MOST_REPORT_ROWS:
        yield from rows
        return
    ended = sorted(
        (row for row in rows if not np.isnan(row["high_omega"])), key=lambda row: row["high"]
    )
    yield from ended[-1:] + ended[:1]


def _rows(columns: Columns) -> Iterator[dict]:
    """Yield the rows of columns, with plain values."""
    for row in zip(*(column.tolist() for column in columns.values()), strict=True):
        yield dict(zip(columns, row, strict=True))


ROUNDED = {  # bounds, to the side on which they hold
    "low": rounded_up,
    "high": rounded_down,
    "fails_below": rounded_down,
    "fails_from": rounded_up,
}


def _text(name: str, value: float | str) -> str:
    """A value of a column."""
    if isinstance(value, str):
        return value
    if np.isnan(value):
        return ""
    if name in ROUNDED:
        return ROUNDED[name](value)
    return f"{value:.6g}"
