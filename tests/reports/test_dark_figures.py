"""Figures on pages in the dark: all colours of curves stand out from the ground."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from wavesweep.program.plots.style import distinct_colour, family_map

ROOT = Path(__file__).parents[2]
PAGES = ("wavesweep/reports/report_page.py", "wavesweep/explore/page.css", "docs/_static/site.css")
FILTER = re.compile(r"filter: invert\((.*?)\) hue-rotate\(180deg\) brightness\((.*?)\)")
# The matrix of hue-rotate(180deg), from the specification of CSS filters.
TURN = np.array([[-0.574, 1.43, 0.144], [0.426, 0.43, 0.144], [0.426, 1.43, -0.856]])


def luminance(colour):
    linear = np.where(colour <= 0.03928, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("page", PAGES)
def test_every_colour_of_a_curve_stands_out_in_the_dark(page):
    filters = FILTER.findall((ROOT / page).read_text(encoding="utf-8"))
    assert filters
    for share, factor in (map(float, each) for each in filters):

        def shown(colour, share=share, factor=factor):
            inverted = share + (1 - 2 * share) * np.array(colour)
            return np.clip(np.clip(TURN @ inverted, 0, 1) * factor, 0, 1)

        ground = luminance(shown((1, 1, 1)))
        family = family_map()(np.linspace(0, 1, 9))[:, :3]
        for colour in (*family, *(to_rgb(distinct_colour(index)) for index in range(6)), (0, 0, 0)):
            assert (luminance(shown(colour)) + 0.05) / (ground + 0.05) >= 3.0, colour
