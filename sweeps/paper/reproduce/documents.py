"""The tables as Markdown, for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import product

import numpy as np

from reproduce.readings import CHOICES, COUPLINGS
from reproduce.specs import load_paper
from reproduce.verdicts import VERDICTS
from wavesweep.program.columns import Columns

_PREFACE = """# The paper's statements

{counted}

- **Reproduced** whatever is inferred: what direct coupling does, what a slow wall costs in stability, what a local model in the
  power domain gains and threatens, and that downsampling makes waves alias (2, 3, 8 to 10, 13, 15, 16, 21, 41).
- **Contradicted**: that filters make the wave channel passive, that a local model of fixed stiffness gains nothing, and the
  axes of Figure 4 (11, 12, 14, 5, 37). All else hangs on an inferred value, or cannot be tested here.

Four things matter for a design:

1. *The wave channel is not passive*: LP1 and filter bank leave its norm above 1 (11, 12, 14; [one that is](passive-bank.md)).
2. *The 800 N/m of Figure 4* need an explicit wall; implicit, every wall is stable (36, 37; [choices](open-choices.md)).
3. *K_LM and Kp matter little for stability* (Figure 5) with an implicit wall, not with an explicit one (38 to 40).
4. *PMW+LM is felt closer to the ideal than PMW* at low frequencies under most readings, at high ones less surely (31 to 34).

## How statements were tried

Words in quotation marks are the paper's own; what follows them says which part is judged. Each statement is tried under
many readings of what the paper leaves open, since its Table 1 is lost: the spec's own values, every single choice below in
their place, and every pair of choices, as far as the loops in question read them.

{choices}

A statement is *reproduced* where it holds under all readings, *contradicted* where under none. Else it is reproduced only
under an inferred value: "holds in" counts the readings, and the last column names the smallest changes of the spec's own
values (the fewest choices) that turn what these say. A loop that is unstable under a reading does not show what is stated;
changes that turn a statement in that way alone stand apart. How each is judged stands below.

Numbers are those of the spec's own values: an implicit wall without delay, exact velocity, LP1 and HP of first order at 10
Hz, LP2 of second order at 20 Hz, an implicit local model with a delay of a tick; then, after a semicolon, those of the first
change that turns it. Values that the paper sets (mass, damping, rates, K_VE, b) are no claims: they stand in the specs. DC
is direct coupling at 1 kHz, the ideal; PMW is passive multirate wave control; PMW+LM is that with filter bank, local model
and Kp. "Off by" is relative to DC.
"""

_NAMED = 4  # changes that the page names; the table has all

_CHOICES = """# What the paper leaves open

The stiffest wall that passive multirate wave control renders at B_VE = 1 N·s/m (N/m), and in brackets by how much it
rises for each N·s/m more of B_VE, on average up to 15; ~ where that is no straight line. "No limit": every wall to
20000 N/m is stable. The paper reads 800 off its Figure 4. LP1 at 10 Hz.
"""


_BANK = """# A filter bank whose way in is passive

The paper says of its filter bank that it "maintains the passivity of the wave-based communication channels". It cannot, and
no choice of LP2 can make it so. The way in adds two returned waves, `v_m = hold(v_s) + LP2 v_l`. Weigh each wave by the
root of its own period and lift over a frame of M ticks: at the angle theta per frame, over its images
`phi_m = (theta + 2 pi m)/M`, the map is `N = [c, diag(LP2_m)]`, where c is the hold, `sum |c_m|^2 = 1`.

- **No LP2 makes it passive.** `N N* = c c* + diag |LP2_m|^2` is at most I only where `sum |c_m|^2/(1 - |LP2_m|^2) <= 1` (Schur
  complement). The `|c_m|^2` add up to 1 and no denominator exceeds 1, so LP2 would have to be 0 at every frequency.
- **With unit gain at 0 Hz the norm is the root of 2, whatever else LP2 is**: there the hold is (1, 0, ..., 0) and the first
  entry of `N N*` is 1 + 1; and where |LP2| <= 1 it is no more than that.
- **Two complementary filters make it exactly 1**: F1, a low-pass behind the hold, and F2, a high-pass in LP2's place, with
  |F1|^2 + |F2|^2 = 1, as a Butterworth pair of one order and cutoff has. Since `c c* <= I`,
  `N N* = diag(F1) c c* diag(F1)* + diag |F2|^2 <= I`, with equality at 0 Hz. A filter of gain 1 at most beside F2, such
  as LP2, keeps both. Numbers do as well as filters: F1 = F2 = 1/sqrt(2) divides both waves by the root of 2.

What it costs is below: the mean deviation of the admittance's magnitude from direct coupling's up to 0.6 rad/sample ("low")
and above ("high"), and the stiffness that the hand feels at 0.05 Hz, for a wall of 500 N/m. F2 in LP2's place ("for LP2")
lets the local model's high frequencies pass, and with a delay of a tick the loop is unstable; without that delay, or with
LP2 kept before it ("after LP2"), it is stable. At low frequencies such a bank is about as far from the ideal as PMW, which
has none, or farther: what the paper's bank gains there is lost. Waves over the root of 2 lose less of it on average, but
half of the wall's stiffness at rest. The way out, which LP1 lets alias, is not passive either (statements 11, 12 and 14);
the mean of a frame in LP1's place makes it so, as [pmw-mean](../../../docs/controllers.md#pmw-mean) has it.

![Admittance with passive ways in, F1 and F2 of first order at 10 Hz](passive-bank.png)
"""


def counted(columns: Columns) -> str:
    """Number of statements with each verdict, in one line. columns: the table of statements."""
    verdicts = columns["verdict"].tolist()
    return f"{len(verdicts)} statements: " + ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in VERDICTS)


def statements_text(columns: Columns) -> str:
    """The table of statements, and below it the quantities by which each one is judged."""
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    cells = [
        (r["number"], r["where"], r["statement"], f"**{r['verdict']}**", _held(r), r["numbers"], _few(r["turned_by"]))
        for r in rows
    ]
    table = _table(("#", "where", "the paper says", "verdict", "holds in", "numbers", "smallest change that turns it"), cells)
    tests = "\n".join(f"{r['number']}. {r['test']}" for r in rows)
    preface = _PREFACE.format(counted=f"{counted(columns)}.", choices=_table(("key", "own", "also"), _choices_tried()))
    return f"{preface}\n{table}\n\n## How each is judged\n\n{tests}\n"


def _choices_tried() -> list[tuple]:
    own = load_paper("fig6").values
    choices = (*CHOICES, *COUPLINGS)
    paths = dict.fromkeys(choice.path for choice in choices)
    others = {path: ", ".join(_short(choice.value) for choice in choices if choice.path == path) for path in paths}
    return [(f"`{path}`", _short(own[path]), others[path]) for path in paths]


def _held(row: Mapping) -> str:
    return f"{row['held']} of {row['readings']}" if row["readings"] else ""


def _few(turned_by: str) -> str:
    """The first changes by name and the number of the others; unstable ones apart."""
    seen, apart, unstable = turned_by.partition("unstable: ")
    return "; ".join(
        f"{before}{'; '.join(names[:_NAMED])}{f' and {len(names) - _NAMED} more' if len(names) > _NAMED else ''}"
        for before, part in (("", seen), (apart, unstable))
        if (names := [name for name in part.split("; ") if name])
    )


def choices_text(columns: Columns) -> str:
    """The study of the open choices on a page."""
    ten_hertz = {name: column[columns["lp1_cutoff_hz"] == 10] for name, column in columns.items()}
    near = _near_800(columns)
    return (
        f"{_CHOICES}\n{_by_design(ten_hertz)}\n\n## The cutoff of LP1\n\nExplicit wall, exact velocity, no delay.\n\n"
        f"{_by_cutoff(columns)}\n\n## Within 1 % of 800 N/m\n\n{_served(columns)}\n\n{_table(near[0], near[1])}\n"
    )


def bank_text(columns: Columns) -> str:
    """The study of filter banks whose way in is passive on a page."""
    head = ("design", "order", "cutoff", "local delay", "norm of the way in", "off, low", "off, high", "felt", "felt, Kp = 0")
    stable = _where(columns, stable=True)
    rows = []
    for row in zip(*stable.values(), strict=True):
        design, order, cutoff, delay, norm, _, low, high, felt, without = row
        filters = (order, f"{cutoff:g} Hz") if order else ("", "")
        found = [f"{value:.3g}" for value in (low, high)] + [f"{value:.4g} N/m" for value in (felt, without)]
        rows.append((design, *filters, delay, f"{norm:.6g}", *found))
    return f"{_BANK}\n{_unstable(columns)}\n\n{_table(head, rows)}\n"


def _unstable(columns: Columns) -> str:
    """Count the designs whose loops are unstable."""
    apart = _where(columns, stable=False)
    kinds = dict.fromkeys(zip(apart["design"].tolist(), apart["local_delay"].tolist(), strict=True))
    named = " and ".join(f"{design} with a local delay of {delay}" for design, delay in kinds)
    return f"{len(apart['design'])} of {len(columns['design'])} loops are unstable: {named}. The others:"


def _by_design(columns: Columns) -> str:
    """Rows: integration, velocity, delay; columns: b and LP1's order. Integrations without any limit take one row."""
    places = list(product(np.unique(columns["b"]), np.unique(columns["lp1_order"])))
    head = ("wall", "velocity", "delay", *(f"b = {b:g}, order {order}" for b, order in places))
    rows = []
    for wall in dict.fromkeys(columns["integration"].tolist()):
        of_wall = _where(columns, integration=wall)
        if np.isnan(of_wall["K_at_1"]).all():
            rows.append((wall, "any", "any", *["no limit"] * len(places)))
            continue
        for velocity, delay in product(dict.fromkeys(of_wall["velocity"].tolist()), np.unique(of_wall["delay"])):
            of_row = _where(of_wall, velocity=velocity, delay=delay)
            cells = [_cell(_where(of_row, b=b, lp1_order=order)) for b, order in places]
            rows.append((wall, velocity, delay, *cells))
    return _table(head, rows)


def _by_cutoff(columns: Columns) -> str:
    chosen = _where(columns, integration="explicit", velocity="exact", delay=0)
    cutoffs = np.unique(chosen["lp1_cutoff_hz"])
    rows = [
        (f"{b:g}", order, *(_cell(_where(chosen, b=b, lp1_order=order, lp1_cutoff_hz=hz)) for hz in cutoffs))
        for b, order in product(np.unique(chosen["b"]), np.unique(chosen["lp1_order"]))
    ]
    return _table(("b", "order", *(f"{hz:g} Hz" for hz in cutoffs)), rows)


def _near_800(columns: Columns) -> tuple[tuple[str, ...], list[tuple]]:
    names = (
        "integration",
        "velocity",
        "delay",
        "b",
        "lp1_order",
        "lp1_cutoff_hz",
        "K_at_1",
        "slope",
        "fig2_stable",
        "fig6_stable",
    )
    near = np.abs(columns["K_at_1"] - 800) <= 8
    picked = [columns[name][near] for name in names]
    return names, [tuple(_short(value) for value in row) for row in zip(*picked, strict=True)]


def _served(columns: Columns) -> str:
    """Say whether some choices serve Figure 4 and the loops of Figures 2 and 6 at once."""
    fits = np.abs(columns["K_at_1"] - 800) <= 8
    both = int((fits & columns["fig2_stable"] & columns["fig6_stable"]).sum())
    return (
        f"{int(fits.sum())} of {len(fits)} choices give Figure 4's 800 N/m. With {both or 'none'} of them the loops of "
        "Figures 2 and 6 (500 N/m, their own b; HP, LP2 and local model as in fig6.toml) are all stable, which the paper's "
        "figures take for granted."
    )


def _cell(row: Columns) -> str:
    """One design: the limit and its slope, or "no limit"."""
    limit, slope, bend, top = (float(row[name][0]) for name in ("K_at_1", "slope", "bend", "K_at_15"))
    if np.isnan(limit):
        return "no limit"
    if np.isnan(slope):
        return f"{limit:.0f}"
    return f"{limit:.0f} ({'~' if bend > 0.05 * top else ''}{slope:.0f})"


def _short(value) -> str:
    if isinstance(value, np.bool_):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _where(columns: Columns, **wanted) -> Columns:
    rows = np.logical_and.reduce([columns[name] == value for name, value in wanted.items()])
    return {name: column[rows] for name, column in columns.items()}


def _table(head: Iterable, rows: Iterable[Iterable]) -> str:
    head = list(head)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines)
