"""Columns of a table, those of complex numbers and of ends of intervals."""

from collections.abc import Iterable, Mapping

import numpy as np

Columns = Mapping[str, np.ndarray]  # of a table, by their names


def complex_columns(name: str, values) -> dict[str, np.ndarray]:
    """Return the columns `name_re`, `name_im`, `name_abs` (in the unit of the values) and `name_deg` of complex numbers.

    A number that is not known, or beyond double precision, is NaN in all four.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        finite = np.where(np.isfinite(np.abs(values)), values, complex(np.nan, np.nan))
        arrays = {"re": finite.real, "im": finite.imag, "abs": np.abs(finite), "deg": np.degrees(np.angle(finite))}
    return {f"{name}_{suffix}": column for suffix, column in arrays.items()}


def joined(blocks: Iterable[Columns]) -> Columns:
    """Blocks of rows as one table."""
    listed = list(blocks)
    return listed[0] if len(listed) == 1 else {name: np.concatenate([block[name] for block in listed]) for name in listed[0]}


def axes_of(columns: Iterable[str], end: str = "along") -> list[str]:
    """Return the names of the axes of a table, which are its columns before `end`."""
    names = list(columns)
    return names[: names.index(end)]


def whose_column(columns: Columns) -> str:
    """Return the column that says for whom, or of which spec, a row of intervals is, if the table has one."""
    return next((name for name in ("hand", "guarantee", "spec") if name in columns), "")


def columns_of_ends(records: np.ndarray, *, set_by: bool) -> Columns:
    """The omegas of records of intervals as columns and, if `set_by`, what sets each end: a mode, or a gain."""
    ends = ("low", "high")
    columns = {f"{end}_omega": np.abs(records[f"{end}_omega"]) for end in ends}
    for end in ends if set_by else ():
        omega = records[f"{end}_omega"]
        cause = np.where(np.signbit(omega), "gain", "mode").astype(object)
        columns[f"{end}_set_by"] = np.where(np.isnan(omega), "", cause)
    return columns


def open_places(columns: Mapping[str, np.ndarray], row: int) -> dict[str, float] | None:
    """The open places of a row: how many, where the first begins, where the last ends; None without."""
    if not columns["open_places"][row]:
        return None
    ends = {side: float(columns[f"open_{end}"][row]) for side, end in (("from", "low"), ("to", "high"))}
    return {"places": int(columns["open_places"][row]), **ends}
