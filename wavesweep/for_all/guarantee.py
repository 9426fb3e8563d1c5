"""The rows of stable intervals that hold for all numbers of [for_all], and for all hands of a box."""

from wavesweep.core.tables.row_kinds import RowKind

ROWS = {
    "box": RowKind(
        "stable with every hand of the box",
        "hands of the box",
        "#D55E00",
        2,
        nowhere="nowhere stable with every hand of the box",
        searched=True,
    ),
    "for_all": RowKind(
        "proved for all numbers of [for_all]",
        "proved for all",
        "#D55E00",
        2,
        "proved",
        "nothing proved for all numbers of [for_all]",
        "largest proved for all",
        proved=True,
    ),
    "mean_square": RowKind(
        "proved in mean square, with messages lost at random",
        "proved in mean square",
        "#D55E00",
        2,
        "proved",
        "nothing proved in mean square",
        "largest proved in mean square",
        proved=True,
    ),
}
