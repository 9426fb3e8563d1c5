"""Columns of a table, those of complex numbers and of ends of intervals, and their names."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

# unit of a value without one in a column of units, where a bare 1 would be read as a number
RATIO = "ratio"

# relative difference of stiffnesses felt, below which none of them is the larger one
FELT_ALIKE = 1e-9
SPARED = 1e-6  # relative error of a response up to which a row has no doubt
# With one of these doubts part of a range may be neither known to be stable nor known to be
# unstable.
INCOMPLETE = ("counts", "crowded", "search", "overflow", "contradiction")

Columns = Mapping[str, "np.ndarray"]  # of a table, by their names


def _names_in_tables() -> frozenset[str]:
    """The names of the columns that `tables/columns.csv` describes."""
    path = Path(__file__).parent / "tables" / "columns.csv"
    with path.open(encoding="utf-8", newline="") as file:
        return frozenset(row["name"] for row in csv.DictReader(file))


# Names of columns of tables, which a number must not have, since it may be an axis. Those of the
# table of passivity stand here: what a spec may say does not depend on the capabilities that are
# there.
TAKEN = _names_in_tables() | {
    "absolutely_stable",
    "channel_hz",
    "channel_norm",
    "channel_omega",
    "channel_passive",
    "damping_margin",
    "damping_needed",
    "llewellyn",
    "port_hz",
    "port_margin",
    "port_omega",
    "port_passive",
    "ports_certified",
    "ports_hz",
    "ports_margin",
    "ports_omega",
}
FREE = "a name that no column of a table has; `wavesweep keys numbers` lists those"
# Names of columns of a simulation; an input, output or named signal with one of these has another
# column, see `run_column`.
RUN_COLUMNS = frozenset(
    (
        *(
            "tick",
            "frame",
            "phase",
            "time_s",
            "f_h",
            "x",
            "v",
            "x_hat",
            "v_hat",
            "f_m",
            "f_device",
            "touching",
            "late",
        ),
        *("u_m", "v_m", "u_s", "v_s", "x_s", "x_dot_s", "F_s", "u_h", "v_l", "v_2"),
        *(f"energy_{part}" for part in ("hand", "device", "user", "slow", "local", "channel")),
    )
)


def run_column(table: str, name: str) -> str:
    """The column of a simulation that shows an input, output or signal; table: inputs, outputs
    or signals."""
    if name in RUN_COLUMNS:
        return f"{table}.{name}"
    return name


def age_column(channel: str) -> str:
    """The column of a simulation with the age of the messages of a channel."""
    return f"age_of_{channel}"


def complex_columns(name: str, values) -> dict[str, np.ndarray]:
    """Return the columns `name_re`, `name_im`, `name_abs` (in the unit of the values) and
    `name_deg` of complex numbers.

    A number that is not known, or beyond double precision, is NaN in all four.
    """
    import numpy as np

    with np.errstate(over="ignore", invalid="ignore"):
        finite = np.where(np.isfinite(np.abs(values)), values, complex(np.nan, np.nan))
        arrays = {
            "re": finite.real,
            "im": finite.imag,
            "abs": np.abs(finite),
            "deg": np.degrees(np.angle(finite)),
        }
    return {f"{name}_{suffix}": column for suffix, column in arrays.items()}


def joined(blocks: Iterable[Columns]) -> Columns:
    """Blocks of rows as one table."""
    import numpy as np

    listed = list(blocks)
    first = listed[0]
    if len(listed) == 1:
        return first
    return {name: np.concatenate([block[name] for block in listed]) for name in first}


def axes_of(columns: Iterable[str], end: str = "along") -> list[str]:
    """Return the names of the axes of a table, which are its columns before `end`."""
    names = list(columns)
    return names[: names.index(end)]


def whose_column(columns: Columns) -> str:
    """Return the column that says for whom, or of which spec, a row of intervals is, if the
    table has one."""
    return next((name for name in ("spec", "hand", "guarantee") if name in columns), "")


def columns_of_ends(records: np.ndarray, set_by: Sequence[str] = ()) -> Columns:
    """The omegas of records of intervals as columns and, with bounds on gains, what sets each end: a
    mode, or the bound of which `set_by` has the word."""
    import numpy as np

    ends = ("low", "high")
    columns = {f"{end}_omega": np.abs(records[f"{end}_omega"]) for end in ends}
    for end in ends if set_by else ():
        omega = records[f"{end}_omega"]
        words = np.array(["mode", *set_by], object)[records[f"{end}_cause"]]
        columns[f"{end}_set_by"] = np.where(np.isnan(omega), "", words)
    return columns


def open_places(columns: Mapping[str, np.ndarray], row: int) -> dict[str, float] | None:
    """The open places of a row: how many, where the first begins, where the last ends; None
    without."""
    if not columns["open_places"][row]:
        return None
    ends = {
        side: float(columns[f"open_{end}"][row]) for side, end in (("from", "low"), ("to", "high"))
    }
    return {"places": int(columns["open_places"][row]), **ends}
