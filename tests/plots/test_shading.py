"""What a figure shows as stable is stable: pixels read back into (x, value), and the spectral radius asked there."""

import numpy as np
import pytest

import wavesweep
from wavesweep import plots
from wavesweep.plots.style import family_looks
from wavesweep.tables.intervals import intervals

pytestmark = pytest.mark.slow

HOLE = {"environment": {"integration": "explicit"}, "controller": {"kind": "pmw"}}
AROUND = 2  # pixels about a point that have its colour


def spec_of(seed):
    """A random loop with waves and few values of B_VE; many of these have holes or islands between them."""
    rng = np.random.default_rng(seed)
    damping = np.unique(np.round(rng.uniform(0, 8, rng.integers(3, 6)), 3)).tolist()
    return {
        "device": {"mass": rng.uniform(0.03, 0.15), "damping": rng.uniform(0.2, 2)},
        "environment": {"integration": "explicit", "delay": int(rng.integers(0, 3))},
        "controller": {"kind": "pmw", "b": rng.uniform(15, 45), "Kp": float(rng.choice([0, 20]))},
        "filters": {"lp1": {"order": 1, "cutoff_hz": rng.uniform(6, 14)}},
        "sweep": {"K_VE": {"start": 0, "stop": 6000}, "B_VE": damping},
    }


def shades(figure, colour, alpha):
    """Points (x, y) of the first panel about which all pixels are of one kind, and whether they are shaded."""
    from matplotlib.colors import to_rgb

    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3] / 255
    shaded = np.abs(pixels - ((1 - alpha) + alpha * np.array(to_rgb(colour)))).max(axis=-1) < 0.02
    white = pixels.min(axis=-1) > 0.99
    axes = figure.axes[0]
    box = axes.get_window_extent()
    columns = np.linspace(box.x0 + 4, box.x1 - 4, 60).astype(int)
    rows = np.linspace(box.y0 + 4, box.y1 - 4, 60).astype(int)
    inverse = axes.transData.inverted()
    x = inverse.transform([(column + 0.5, rows[0]) for column in columns])[:, 0]
    y = inverse.transform([(columns[0], row + 0.5) for row in rows])[:, 1]
    height = pixels.shape[0]

    def whole(kind):
        return np.array(
            [
                [kind[height - 1 - r - AROUND : height + AROUND - r, c - AROUND : c + AROUND + 1].all() for c in columns]
                for r in rows
            ]
        )

    return x, y, whole(shaded), whole(white)


def held_against_the_radius(spec, figure, names, alpha=0.22):
    """Check that shaded points are stable; return the numbers of shaded points, of white ones, and of stable white ones."""
    x, y, shaded, white = shades(figure, family_looks(1)[0].colour, alpha)
    loop = wavesweep.compile(spec)
    inside = y >= 0
    radius = loop.spectral_radius(**{names[1]: y[inside].tolist(), names[0]: np.maximum(x, 0).tolist()})
    assert radius[shaded[inside]].max(initial=0.0) < 1
    return int(shaded[inside].sum()), int(white[inside].sum()), int((radius[white[inside]] < 1).sum())


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", range(8))
def test_what_is_shaded_over_the_walls_plane_is_stable_and_what_is_white_is_not(seed):
    spec = spec_of(seed)
    table = intervals(wavesweep.load(spec))
    shaded, white, missed = held_against_the_radius(spec, plots.zwidth(table.columns, table.facts), ("B_VE", "K_VE"))
    assert shaded > 100
    assert white > 50
    assert missed == 0


def test_what_is_shaded_along_another_number_is_stable():
    spec = HOLE | {"sweep": {"along": "b", "b": {"start": 2, "stop": 100}, "K_VE": [200.0, 500.0, 800.0, 1400.0]}}
    table = intervals(wavesweep.load(spec))
    figure = plots.stability_region(table.columns, table.facts)
    shaded, *_ = held_against_the_radius(spec, figure, ("K_VE", "b"))
    assert shaded > 100


def test_bars_are_stable_and_nothing_between_them_is_shaded():
    spec = HOLE | {"filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}}, "sweep": {"b": [20.0, 25.0]}}
    table = intervals(wavesweep.load(spec))
    x, y, shaded, white = shades(plots.zwidth(table.columns, table.facts), family_looks(1)[0].colour, 0.25)
    place = np.rint(y).astype(int)
    on = (place >= 0) & (place < 2) & (np.abs(y - place) < 0.25)
    inside = (x >= 0) & (x <= 20000)
    radius = wavesweep.compile(spec).spectral_radius(b=table.facts["spec"]["sweep"]["b"], K_VE=x[inside].tolist())
    rows = radius[place[on]]
    assert shaded[on][:, inside].sum() > 50
    assert rows[shaded[on][:, inside]].max() < 1
    assert rows[white[on][:, inside]].min() > 1
    assert not shaded[np.abs(y - place) > 0.4].any()


def test_without_the_spec_nothing_is_shaded_between_the_values_of_the_table():
    table = intervals(wavesweep.load(spec_of(0)))
    *_, shaded, _ = shades(plots.zwidth(table.columns, {}), family_looks(1)[0].colour, 0.22)
    assert not shaded.any()


def test_whole_numbers_have_nothing_between_them():
    spec = {"controller": {"kind": "pmw"}, "sweep": {"environment.delay": list(range(12)), "K_VE": {"start": 0, "stop": 4000}}}
    table = intervals(wavesweep.load(spec))
    figure = plots.zwidth(table.columns, table.facts)
    *_, shaded, _ = shades(figure, family_looks(1)[0].colour, 0.22)
    assert not shaded.any()
    low, high = figure.axes[0].get_xlim()
    assert low < 0  # so that the bars at both ends are whole
    assert high > 11
