"""What a figure of intervals draws, held against its table: random tables with holes, few values, doubts, ranges and panels.

What lies between the values of a table comes from functions that the tests know, in place of loops. Nothing is rendered.
"""

import re
from itertools import pairwise, product

import numpy as np
import pytest
from matplotlib.colors import same_color, to_rgb

import wavesweep
from wavesweep.program import plots
from wavesweep.program.analyses import plane_columns
from wavesweep.program.analyses.plane_columns import Interval
from wavesweep.program.plots.region_figures import FELT, LADDER
from wavesweep.program.plots.style import DOUBTFUL

pytestmark = [pytest.mark.whole, pytest.mark.slow]

TOP, KINDS = 2000.0, ("", "", "guarantee", "hand", "spec")
WORDS = {"guarantee": ("spec", "for_all", "mean_square"), "hand": ("free", "box", "passive"), "spec": ("one", "two")}
AT_VALUES = ("for_all", "mean_square", "box", "passive")
TABLES = {
    "controller": {"kind": "pmw-lm"},
    "environment": {"B_VE": 0.5},
    "sweep": {"K_VE": {"start": 0, "stop": TOP}, "B_VE": [0.0, 1.0]},
}


class Truth:
    """Straight intervals over x, one above the other, of which each may begin or end somewhere, with stretches in doubt."""

    def __init__(self, rng, span):
        whole = span[1] - span[0]
        ends = np.sort(rng.uniform(100, 1900, (2, 2 * rng.integers(0, 3))), axis=1)
        self.ends, self.span = ends, span
        self.lives = [(span[0], span[1]) if rng.random() < 0.5 else np.sort(rng.uniform(*span, 2)) for _ in ends[0, ::2]]
        self.first, self.last = rng.random(2) < 0.5  # whether the range ends the outer intervals
        at = rng.uniform(*span)
        self.doubt = (at, at + rng.uniform(0.02, 0.4) * whole) if rng.random() < 0.4 else (np.inf, np.inf)
        self.felt = [(0.4, 0), (1.0, 0), (1.001, 0), (np.nan, 0), (-0.5, TOP)][
            rng.integers(5)
        ]  # of the last, soft walls feel stiff
        self.open = rng.random() < 0.3
        if rng.random() < 0.3:
            self.ends = np.round(self.ends, -3)  # 0 and the top alone

    def column(self, x):
        """The intervals at x, and what is not known there."""
        share = (x - self.span[0]) / max(self.span[1] - self.span[0], 1e-9)
        ends = self.ends[0] * (1 - share) + self.ends[1] * share
        doubtful, found = self.doubt[0] <= x <= self.doubt[1], []
        for number, ((begin, end), pair) in enumerate(zip(self.lives, ends.reshape(-1, 2).tolist(), strict=True)):
            first, last = self.first and number == 0, self.last and number == len(ends) // 2 - 1
            low, high = 0.0 if first else pair[0], TOP if last else pair[1]
            if begin <= x <= end and low < high:
                share, rest = self.felt
                felt = share * low + rest, share * high + rest
                found.append(Interval(low, high, not first, not last, not doubtful, *felt))
        unknown = ((TOP * 0.97, TOP * 0.99),) if doubtful and self.open and not (found and found[-1].high > 1900) else ()
        return tuple(found), unknown


class Between:
    """A source of columns between those of a table."""

    cost, dear, x = 1e-4, False, "environment.B_VE"

    def __init__(self, keys, truths):
        self.keys, self.designs, self.truths = keys, list(dict.fromkeys(keys)), truths

    def ask(self, wanted):
        return [self.truths[self.designs[number]].column(x) for number, x in wanted]


def table(seed):
    """A table, the truth of each of its designs, and the column that says whose its rows are."""
    rng = np.random.default_rng(seed)
    whose = str(rng.choice(KINDS))
    values = np.unique(np.round(np.sort(rng.uniform(0, 4, rng.choice([1, 2, 2, 3, 5, 9, 17]))), 3))
    family = [10.0, 20.0, 30.0, 40.0][: rng.integers(1, 5)] if whose == "" or rng.random() < 0.3 else [10.0]
    panels = [0.0, 500.0, 700.0, 900.0][: rng.integers(1, 5)] if whose == "" and rng.random() < 0.4 else [500.0]
    words = WORDS.get(whose, ("",))[: rng.integers(2, 4) if whose else 1]
    rows, truths = [], {}
    for b, k, word in product(family, panels, words):
        truth = truths[b, k, word] = Truth(rng, (values[0], values[-1]))
        for x in values.tolist():
            found, unknown = truth.column(x)
            for number, each in enumerate(found or [None]):
                low, high = (each.low, each.high) if each else (np.nan, np.nan)
                certified = each.certified if each else not unknown
                fails = (high + rng.uniform(0, 300)) if word in ("for_all", "mean_square") and rng.random() < 0.7 else np.nan
                rows.append(
                    {
                        "B_VE": x,
                        "b": b,
                        "K_LM": k,
                        "along": "K_VE",
                        **({whose: word} if whose else {}),
                        "intervals": len(found),
                        "interval": number,
                        "low": low,
                        "high": high,
                        "low_omega": 3.0 if each and each.low_real else np.nan,
                        "high_omega": 4.0 if each and each.high_real else np.nan,
                        "certified": certified,
                        "doubt": "" if certified else "rounding",
                        "felt_low": each.felt_low if each else np.nan,
                        "felt_high": each.felt_high if each else np.nan,
                        "open_places": int(bool(unknown) and number == 0),
                        "open_low": unknown[0][0] if unknown and number == 0 else np.nan,
                        "open_high": unknown[0][1] if unknown and number == 0 else np.nan,
                        **({"fails_below": np.nan, "fails_from": fails} if whose == "guarantee" else {}),
                        **({"settled": bool(rng.random() < 0.7)} if whose in ("guarantee", "hand") else {}),
                    }
                )
    kinds = {"along": object, "doubt": object, "certified": bool, "settled": bool, **({whose: object} if whose else {})}
    columns = {name: np.array([row[name] for row in rows], kinds.get(name)) for name in rows[0]}
    if whose == "spec":
        columns = {"spec": columns.pop("spec")} | columns
    return columns, truths, whose


def drawn(seed, monkeypatch):
    """The figure of a table, with what it was drawn from."""
    columns, truths, whose = table(seed)
    computed = whose != "spec" and seed % 3 > 0

    def source(members, x, _):
        word = str(members[0][whose][0]) if whose else ""
        if not computed or x != "B_VE" or word in AT_VALUES:
            return None
        return Between([(rows["b"][0], rows["K_LM"][0], word) for rows in members], truths)

    monkeypatch.setattr(plane_columns, "_source", source)
    monkeypatch.setattr("wavesweep.program.plots.style._settle", lambda _: None)
    facts = {"spec": wavesweep.load(TABLES).tables(), "spec_name": "hard"} if whose != "spec" else {}
    draw = plots.zwidth_specs if whose == "spec" else plots.zwidth
    return draw(columns, facts), columns, truths, whose, computed


class Artists:
    """What is drawn in axes, in data."""

    def __init__(self, axes):
        self.filled, self.dotted, self.unknown, self.lines = [], [], [], []  # polygons, and (label, colours, path) of lines
        self.beyond, self.carets, self.points = False, False, {}
        for each in (*axes.patches, *axes.collections):
            if hasattr(each, "get_segments"):
                self.lines += [(each.get_label(), each.get_colors()[0], path.tolist()) for path in each.get_segments()]
                continue
            paths = (
                each.get_paths() if hasattr(each, "get_paths") else [each.get_path().transformed(each.get_patch_transform())]
            )
            self.beyond |= each.get_hatch() == "...."
            colour = np.ravel(each.get_facecolor())[:3]
            hatches = {"ooo": self.dotted, "/////": self.unknown, "....": []}
            into = hatches[each.get_hatch()] if each.get_hatch() else [] if same_color(colour, "white") else self.filled
            into += [path for path in paths if len(path.vertices) > 2]
        for line in axes.lines:
            self.carets |= bool(line.get_marker() in (8, 9, 10, 11) and len(line.get_xdata()))
            self.points.setdefault(line.get_marker(), []).append((line, line.get_xydata()))

    def bars(self, where):
        """Lines upright at one of these values, but ladders."""
        return [
            (colour, path[0][0], *sorted((path[0][1], path[1][1])))
            for label, colour, path in self.lines
            if len(path) == 2 and path[0][0] == path[1][0] and path[0][0] in where and label not in (LADDER, FELT)
        ]


def is_red(colour):
    return same_color(colour, DOUBTFUL)


def paler_of(colour, looks):
    """Whether a colour is one of these, or a mixture of it with white."""
    one = 1 - np.array(to_rgb(colour))
    return any(np.linalg.norm(np.cross(one, 1 - np.array(to_rgb(look)))) < 1e-6 for look in looks)


def entries(figure):
    """The texts of the legends with their handles."""
    legends = [*figure.legends, *(each for axes in figure.axes if (each := axes.get_legend()))]
    return {
        text.get_text(): handle
        for legend in legends
        for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True)
    }


def inside(paths, x, y):
    return any(path.contains_point((x, y), radius=1e-9) or path.contains_point((x, y), radius=-1e-9) for path in paths)


def rows_of(columns, axes):
    """The rows of a panel, whose title has the value of an axis."""
    if not (found := re.search(r"= ([\d.]+)", axes.get_title())):
        return columns
    chosen = columns["b" if "$b$" in axes.get_title() else "K_LM"] == float(found[1])
    return {name: column[chosen] for name, column in columns.items()}


def check_panel(artists, rows, truths, computed, height):
    """No more is filled than rows cover, and colours and dashes are those of their certificates."""
    sure = rows["certified"]
    stable = rows["intervals"] > 0
    values = np.unique(rows["B_VE"]).tolist()
    ends = [(rows["B_VE"], rows[end], sure) for end in ("low", "high")]
    certain, doubted = (
        {(x, y) for each in ends for x, y, ok in zip(*each, strict=True) if ok == kind} for kind in (True, False)
    )
    rng, near = np.random.default_rng(0), 3e-3 * height
    for x in values:
        at = stable & (rows["B_VE"] == x)
        for y in rng.uniform(0, TOP, 25):
            covers = at & (rows["low"] - near <= y) & (y <= rows["high"] + near)
            if inside(artists.filled, x, y):
                assert covers.any(), f"filled at {x}, {y:g}, which no row covers"
                if not sure[covers].any():
                    assert inside(artists.dotted, x, y), f"not dotted at {x}, {y:g}, which is not certified"
    doubtful_at = {
        x: bool((~sure[stable & (rows["B_VE"] == x)]).any() or rows["open_places"][rows["B_VE"] == x].any()) for x in values
    }
    between = [key for key in truths if key[2] not in AT_VALUES]
    for left, right in pairwise(values):
        for x, y in zip(rng.uniform(left, right, 12), rng.uniform(0, TOP, 12), strict=True):
            if inside(artists.filled, x, y):
                assert computed, f"filled at {x}, {y:g}, where nothing is computed"
                pixel = (values[-1] - values[0]) / 200
                known = [each for key in between for step in (-pixel, 0, pixel) for each in truths[key].column(x + step)[0]]
                assert any(each.low - near <= y <= each.high + near for each in known), f"filled at {x}, {y:g}: not stable"
            if inside(artists.dotted, x, y):
                assert doubtful_at[left] or doubtful_at[right]
    bars = artists.bars(values)
    for colour, x, low, high in bars:
        alike = stable & (rows["B_VE"] == x) & np.isclose(rows["low"], low) & np.isclose(rows["high"], high)
        assert alike.any(), f"a bar at {x} from {low:g} to {high:g} without a row"
        assert (~sure if is_red(colour) else sure)[alike].any(), f"the bar at {x} has the colour of another certificate"
    for label, colour, path in artists.lines:
        if label in (LADDER, FELT) or (len(path) == 2 and path[0][0] == path[1][0]):
            continue
        for x, y in path:
            if not is_red(colour):
                assert (x, y) not in doubted - certain, f"a boundary at {x}, {y:g} in the colour of what is certified"
        first, last = (np.clip(at(x for x, _ in path), values[0], values[-1]) for at in (min, max))
        if is_red(colour):
            beside = [x for x in values if (last >= x >= first)]
            beside += [max(x for x in values if x <= first), min(x for x in values if x >= last)]
            assert any(doubtful_at[x] for x in beside), f"red from {first:g} to {last:g} between certified rows"


def check_legend(figure, panels):
    """What is drawn is in the legend, and what is in the legend is drawn."""
    said, everything = entries(figure), [each for artists in panels for each in artists.lines]
    red = any(is_red(colour) for _, colour, _ in everything) or any(
        is_red(line.get_color()) for artists in panels for each in artists.points.values() for line, _ in each
    )
    found = {
        "not certified": red or any(artists.dotted for artists in panels),
        "not known": any(artists.unknown for artists in panels) or any(label == LADDER for label, *_ in everything),
        "refuted from here": any(artists.carets for artists in panels),
        "beyond the swept range": any(artists.beyond for artists in panels),
        "stiffness felt at the limit": any(label == FELT for label, *_ in everything)
        or any(line.get_label() == FELT for artists in panels for each in artists.points.values() for line, _ in each),
        "nominal design": any(len(at) for artists in panels for _, at in artists.points.get("x", ())),
    }
    assert {word: word in said for word in found} == found
    marks = {*found, *(text for text in said if re.match("largest|stiffest", text))}
    members = {text: handle for text, handle in said.items() if text not in marks}
    looks = [handle.get_color() for handle in members.values()]
    colours = [colour for label, colour, _ in everything if label not in (LADDER, FELT) and not is_red(colour)]
    if looks:  # a single region has no entry
        assert all(paler_of(colour, looks) for colour in colours)
    for text, handle in members.items():
        if not text.endswith((": none", ": whole range")) and not red:
            assert any(
                paler_of(handle.get_color(), [colour]) or paler_of(colour, [handle.get_color()]) for colour in colours
            ), text


def check_star(figure, panels, columns, whose):
    """The star is at the row that its words name, which is the best of all of its kind."""
    words = [text for text in entries(figure) if re.match("largest|stiffest", text)]
    stars = [at for artists in panels for _, at in artists.points.get("*", ())]
    assert len(words) == len(stars) == bool((columns["intervals"] > 0).any() and whose != "spec")
    if not stars:
        return
    kinds = [word for word in AT_VALUES[::-1] if whose in columns and (columns["intervals"][columns[whose] == word] > 0).any()]
    rows = columns["intervals"] > 0
    promised = [word for word in ("for_all", "mean_square", "box", "passive") if word in kinds]
    named = next((word for word in promised if _legend(word) in words[0]), None)
    assert bool(promised) == bool(named)
    rows &= columns[whose] == named if named else ~np.isin(columns.get(whose, np.full(rows.size, "")), promised)
    rows &= columns["certified"] if (rows & columns["certified"]).any() else True
    found = re.search(r": (at least )?([\d.e+]+)", words[0])
    number = float(found[2])
    felt = words[0].startswith("stiffest felt")
    known = rows & ~np.isnan(columns["felt_high"])
    known = known if known.any() else rows
    ends = [np.where(known, columns[f"felt_{end}" if felt else end], -np.inf) for end in ("low", "high")]
    most = np.max(ends) if felt else columns["high"][rows].max()
    assert number == pytest.approx(most, rel=1e-3)
    assert felt or bool(found[1]) == (most == TOP)  # where the swept range ends it, nothing larger was asked
    best = [
        (x, y)
        for end, merit in zip(("low", "high"), ends, strict=True)
        for x, y, size in zip(columns["B_VE"], columns[end], merit, strict=True)
        if size >= most * (1 - 1e-9)
    ]
    along = len(np.unique(columns["B_VE"])) > 1
    assert any(stars[0][0].tolist() == [x, y] if along else y in stars[0][0] for x, y in best)


def check_bars(axes, rows, whose):
    """A bar for each stable row, dotted if it is not certified, and nothing else."""
    sure, stable = rows["certified"], rows["intervals"] > 0
    for kind in (True, False):
        bars = [
            each.get_bbox().intervalx.tolist()
            for each in axes.patches
            if hasattr(each, "get_bbox") and each.get_hatch() == (None if kind else "ooo")
        ]
        of_rows = zip(rows["low"][stable & (sure == kind)], rows["high"][stable & (sure == kind)], strict=True)
        assert np.array(sorted(bars)) == pytest.approx(np.array(sorted(map(list, of_rows))))
    lines = [(is_red(colour), path[0][0]) for _, colour, path in Artists(axes).lines]
    ends = [
        (not ok, value)
        for end in ("low", "high")
        for ok, value, omega in zip(sure[stable], rows[end][stable], rows[f"{end}_omega"][stable], strict=True)
        if omega > 0
    ]
    if whose != "guarantee":  # ends of what is proved have no oscillation, and a stroke
        assert np.array(sorted(lines)) == pytest.approx(np.array(sorted(ends)))


def _legend(word):
    return {
        "for_all": "proved for all",
        "mean_square": "in mean square",
        "box": "hands of the box",
        "passive": "every passive hand",
    }[word]


@pytest.mark.parametrize("seed", [round(i * 999 / 99) for i in range(0, 100, 4)])
def test_a_figure_of_intervals_draws_what_its_table_says(seed, monkeypatch):
    figure, columns, truths, whose, computed = drawn(seed, monkeypatch)
    shown = [axes for axes in figure.axes if axes.get_visible()]
    panels = [Artists(axes) for axes in shown]
    check_legend(figure, panels)
    check_star(figure, panels, columns, whose)
    for axes, artists in zip(shown, panels, strict=True):
        rows = rows_of(columns, axes)
        if len(np.unique(columns["B_VE"])) > 1:
            check_panel(artists, rows, truths, computed, np.ptp(axes.get_ylim()))
        elif figure.get_supxlabel().startswith(r"$K_\mathrm{VE}$"):  # and not over another axis
            check_bars(axes, rows, whose)
