"""What [for_all] leaves open is hatched, and what it refutes has a caret, in the figures of intervals."""

import numpy as np
import pytest

from wavesweep.program import plots
from wavesweep.program.analyses.claim_words import fact_of
from wavesweep.program.analyses.claims import STABLE, Claim, Scope, Status
from wavesweep.program.plots.region_figures import LADDER

from .conftest import table_of_intervals

FACTS = {"claims": {"for_all": fact_of(Claim(STABLE, Scope(), Status.PROVED))}}

SPEC, PROVED, REFUTED = 1000.0, 400.0, 600.0


def table(axis, values, *, proved=True, none=False):
    """A table of one axis along K_VE from 0 to 2000: proved up to 400 of 1000 N/m, refuted from 600 on, or nothing proved.

    none: it is certified that nothing is stable.
    """
    own = [((value,), [(0.0, SPEC, np.nan, 40.0, True)]) for value in values]
    every = [((value,), [(0.0, PROVED, np.nan, np.nan, True)] if proved else []) for value in values]
    both = [table_of_intervals([axis], "K_VE", rows) for rows in (own, every)]
    columns = {name: np.concatenate([part[name] for part in both]) for name in both[0]}
    rows = len(columns["along"])
    guarantee = np.repeat(np.array(["spec", "for_all"], object), rows // 2)
    known = (guarantee == "for_all") & proved
    more = {"fails_below": np.full(rows, np.nan), "fails_from": np.where(known, REFUTED, np.nan)}
    more |= {"settled": guarantee == "spec", "counterexample": np.full(rows, "", object)}
    certified = (guarantee == "spec") | proved | none
    return columns | {"guarantee": guarantee, "certified": certified} | more


def hatched(axes):
    """Corners of the hatches of what is not known, in data."""
    parts = [
        patch.get_path().transformed(patch.get_patch_transform()) for patch in axes.patches if patch.get_hatch() == "/////"
    ]
    parts += [path for each in axes.collections if each.get_hatch() == "/////" for path in each.get_paths()]
    return [{tuple(np.round(corner, 9).tolist()) for corner in part.vertices} for part in parts if len(part.vertices)]


def carets(axes):
    return [point for line in axes.lines if line.get_marker() in (8, 9, 10, 11) for point in zip(*line.get_data(), strict=True)]


def said(figure):
    legends = [*figure.legends, *(legend for axes in figure.axes if (legend := axes.get_legend()))]
    return [text.get_text() for legend in legends for text in legend.get_texts()]


@pytest.mark.whole
def test_a_plane_shows_what_is_proved_not_known_and_refuted_at_the_swept_values():
    figure = plots.zwidth(table("B_VE", [0.0, 1.0, 2.0]), FACTS)
    (axes,) = figure.axes
    assert carets(axes) == [(0.0, REFUTED), (1.0, REFUTED), (2.0, REFUTED)]
    drawn = [each for each in axes.collections if each.get_segments()]
    _, bars = ([(low[0], low[1], high[1]) for low, high in each.get_segments()] for each in drawn if each.get_label() != LADDER)
    (ladders,) = (
        [(low[0], low[1], high[1]) for low, high in each.get_segments()] for each in drawn if each.get_label() == LADDER
    )
    assert bars == [(x, 0.0, PROVED) for x in (0.0, 1.0, 2.0)]  # and nothing between them
    assert ladders == [(x, PROVED, REFUTED) for x in (0.0, 1.0, 2.0)]
    ends = [line.get_xydata().tolist() for line in axes.lines if line.get_marker() == "_"]
    assert [[x, PROVED] for x in (0.0, 1.0, 2.0)] in ends
    (star,) = [line.get_xydata().tolist() for line in axes.lines if line.get_marker() == "*"]
    assert star == [[0.0, PROVED]]  # the best of what is proved, not of the nominal numbers
    assert [text for text in said(figure) if text in ("proved for all", "not known", "refuted from here")] == [
        "proved for all",
        "not known",
        "refuted from here",
    ]
    assert "beyond the swept range" not in said(figure)  # what is proved ends before that, though no oscillation is named


@pytest.mark.whole
def test_a_bar_shows_the_same_and_nothing_proved_is_said():
    (axes,) = plots.zwidth(table("b", [10.0]), FACTS).axes
    assert carets(axes) == [(REFUTED, pytest.approx(0.808))]  # below the star
    (part,) = hatched(axes)
    assert {x for x, _ in part} == {PROVED, REFUTED}
    figure = plots.zwidth(table("b", [10.0], proved=False), FACTS)
    (axes,) = figure.axes
    assert "nothing proved" in [text.get_text() for text in axes.texts]
    (whole,) = hatched(axes)
    assert {x for x, _ in whole} == {0.0, axes.get_xlim()[1]}
    assert "not known" in said(figure)
    figure = plots.zwidth(table("b", [10.0], proved=False, none=True), FACTS)
    (axes,) = figure.axes
    assert "nowhere stable" in [text.get_text() for text in axes.texts]
    assert hatched(axes) == []  # since that is known
    assert "not known" not in said(figure)
