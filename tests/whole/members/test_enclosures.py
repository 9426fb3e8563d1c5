"""Frames that are enclosed over cells hold those of members, whose matrices are written elsewhere.

A trace is compared: it is the same in other states, and states that every frame forgets add nothing.
"""

from dataclasses import replace

import numpy as np
import pytest
from support import together

from wavesweep.engine._sets.taylor_models import TaylorModel
from wavesweep.for_all.frames_over import FramesOver, constant_frames
from wavesweep.for_all.rows import cases_of
from wavesweep.for_all.sides import as_numbers, as_sides, side_of
from wavesweep.for_all.varying import Rules
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

CELLS, POINTS = 6, 24  # cells of a box, and members in each
WIDTHS = -2.0, 0.0  # powers of ten of the width of a cell, relative to the box
POWERS = 3  # of frames, so that what goes about a ring comes back
HUGE = 1e6  # what is left out, above which nothing is said
ROUNDING = 1e-11  # of the entries
SAME_FRAMES = "alone", "frames", "frames at random"  # whose symbols are those of the matrices here


def loops(name, count):
    """Random loops of a kind, in which frames are alike or differ in length."""
    found, seed = [], 0
    while len(found) < count:
        loop = together.KINDS[name](np.random.default_rng([seed, 3]))
        seed += 1
        if loop.varied.name in SAME_FRAMES:
            found.append(loop)
    return found


def enclosed(loop):
    """Yield cells of a loop as the frames, their sides and the box of these."""
    spec = load(loop.tables)
    rules = Rules.of(spec)
    for case in cases_of(rules, "", (0.0, 0.0), own_loop(spec)):
        paths = [axis.path for axis in case.ranges]
        sides = [side_of(*case.loop, path, ends) for path, ends in zip(paths, case.box.T, strict=True)]
        whole = as_sides(case.box, sides)
        if rules.vary:
            yield rules.plan(case.values, paths).over(sides, whole), sides, whole
        else:
            yield constant_frames(case.loop, sides, whole), sides, whole


def off_trace(frames, units, members):
    """By how much traces of members are off that of polynomials, relative to what these leave out."""
    own = np.trace(members, axis1=-2, axis2=-1)
    powers = (units[:, None] ** frames.exponents).prod(-1)
    polynomials = (powers @ np.trace(frames.terms, axis1=-2, axis2=-1)).T
    rest = np.trace(frames.rest, axis1=-2, axis2=-1)[:, None]
    size = ROUNDING * (1 + frames.whole.sum((-2, -1)))[:, None]
    return float((np.maximum(np.abs(own - polynomials) - size, 0) / rest).max())


def beyond(loop, rng):
    """The same for powers of the frames of random cells."""
    far = []
    for frames, sides, whole in enclosed(loop):
        for _ in range(CELLS):
            half = np.ptp(whole, axis=0) / 2 * 10 ** rng.uniform(*WIDTHS)
            middle = rng.uniform(whole[0] + half, whole[1] - half)
            found = frames.over(np.array([[middle - half, middle + half]]))[0]
            if isinstance(found, int) or found.matrices.rest.max() > HUGE:
                continue
            units = rng.uniform(-1, 1, (POINTS, half.size))
            units[::2] = np.sign(units[::2])
            points = np.clip(as_numbers(middle + half * units, sides), *loop.box)
            members = loop.maps(points, loop.amplitude)
            own, power = members, found.matrices
            for _ in range(POWERS):
                far.append(off_trace(power, units, own))
                own, power = own @ members, power @ found.matrices
    return far


@pytest.mark.slow
@pytest.mark.parametrize("name", together.KINDS)
def test_members_of_a_cell_are_within_what_encloses_them(name):
    rng, far = np.random.default_rng(1), []
    for loop in loops(name, 8):
        far += beyond(loop, rng)
    assert len(far) > CELLS
    assert max(far) <= 1


@pytest.mark.parametrize("share", [1.0, 0.1], ids=["all of it", "a tenth"])
@pytest.mark.parametrize("function", ["sin", "cos", "exp", "log", "sqrt", "inverse"])
def test_functions_of_a_side_are_off_by_more_than_a_tenth_of_the_remainder(function, share, monkeypatch):
    composed = TaylorModel._composed

    def with_a_share(self, coefficients, left_out):
        return composed(self, coefficients, share * left_out)

    monkeypatch.setattr(TaylorModel, "_composed", with_a_share)
    units = np.linspace(-1, 1, 101)
    far = []
    for low, high in ((0.5, 1.5), (1.0, 3.0), (2.0, 2.5)):
        model = getattr(TaylorModel.side(0, low, high, 1, 4), function)()
        value = np.polynomial.polynomial.polyval(units, model.terms)
        own = (np.reciprocal if function == "inverse" else getattr(np, function))((low + high) / 2 + (high - low) / 2 * units)
        far.append(np.abs(own - value).max() / model.rest)
    assert (max(far) > 1) == (share < 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", together.KINDS)
def test_a_tenth_of_what_frames_leave_out_is_too_little(name, monkeypatch):
    over = FramesOver.over

    def with_a_tenth(self, cells):
        (found,) = over(self, cells)
        if isinstance(found, int):
            return [found]
        return [replace(found, matrices=replace(found.matrices, rest=found.matrices.rest / 10))]

    monkeypatch.setattr(FramesOver, "over", with_a_tenth)
    rng = np.random.default_rng(1)
    assert any(max(beyond(loop, rng), default=0) > 1 for loop in loops(name, 8))
