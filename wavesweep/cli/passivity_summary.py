"""What a user wants to know of the passivity of a design before opening its tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

Line = tuple[str, bool]


def passivity(columns: Mapping[str, np.ndarray], facts: Mapping[str, Any]) -> Iterator[Line]:
    """Give lines, each with whether it is a warning."""
    rows = len(columns["channel_norm"])
    norms = columns["channel_norm"][~np.isnan(columns["channel_norm"])]
    if norms.size:
        passive = int(columns["channel_passive"].sum())
        yield f"channel: passive in {passive} of {_rows(rows)}; norm {_range(norms)}", False
    margins = columns["port_margin"][~np.isnan(columns["port_margin"])]
    reach = f"; margin {_range(margins)} m/N" if margins.size else ""
    yield f"hand's port: passive in {int(columns['port_passive'].sum())} of {_rows(rows)}{reach}", False
    slices = facts["slices"]
    if slices["certified"] < slices["computed"]:
        yield f"{slices['computed'] - slices['certified']} of {slices['computed']} loops not certified", True


def filter_choices(columns: Mapping[str, np.ndarray]) -> Iterator[Line]:
    """Give the least order at each cutoff that keeps aliasing from adding much energy."""
    order = dict(zip(columns["lp1_cutoff_hz"].tolist(), columns["sufficient_order"].tolist(), strict=True))
    known = [f"{each:g} at {cutoff:g} Hz" for cutoff, each in order.items() if not np.isnan(each)]
    yield f"least order of LP1 with which aliasing adds at most 0.1 % of energy: {', '.join(known) or 'none'}", False
    beyond = [f"{cutoff:g} Hz" for cutoff, each in order.items() if np.isnan(each)]
    if beyond and known:
        yield f"no order up to {columns['lp1_order'].max()} is enough at {', '.join(beyond)}", False


def _rows(number: int) -> str:
    return f"{number} row{'' if number == 1 else 's'}"


def _range(values: np.ndarray) -> str:
    low, high = values.min(), values.max()
    return f"{low:.7g}" if low == high else f"{low:.7g} to {high:.7g}"
