"""A refusal is never about signs or excitation if plain least squares explain the log to a tenth."""

from itertools import product

import numpy as np
import pytest
from simulated_logs import KINDS, of_one_mass

import wavesweep
from wavesweep.engine.errors import UsageError

SPANS = (1, 2, 4, 8, 16, 32)  # rows between the readings of a second difference
DELAYS = range(11)  # ticks
FORMS = ("as it is", "turned", "shuffled", "another device", "five rows", "scaled")


def unexplained(force, reading, period):
    """The least share of second differences of the reading that a force, a speed and a constant leave, with a positive mass.

    Over a span of w rows the difference of a double integrator is that of the force weighted by a triangle.
    """
    least = 1.0
    for span, delay in product(SPANS, DELAYS):
        triangle = np.convolve(np.ones(span), np.ones(span)) / span**2
        late = np.append(np.full(delay, force[0]), force[: len(force) - delay])
        weighted = np.convolve(late, triangle, "valid")  # of the rows from span before to span after
        rows = slice(span, len(reading) - span)
        seconds = span * period
        acceleration = (reading[2 * span :] - 2 * reading[rows] + reading[: -2 * span]) / seconds**2
        speed = (reading[2 * span :] - reading[: -2 * span]) / (2 * seconds)
        pushed = weighted[: len(acceleration)]
        columns = np.stack([pushed, speed, np.ones(len(speed))], axis=1)
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        gains = np.linalg.lstsq(columns, acceleration, rcond=None)[0]
        left = acceleration - columns @ gains
        if gains[0] > 0:
            least = min(least, left.std() / acceleration.std())
    return float(least)


def log_of(source, form):
    """Force, reading and period of a random log, in one of several forms."""
    kind = list(KINDS)[source.integers(len(KINDS))]
    rate_hz = float(source.choice([200.0, 500.0, 1000.0, 4000.0]))
    first, other = of_one_mass(kind, 2, int(source.integers(1000)), 300 / rate_hz * source.uniform(1, 4), rate_hz)
    force = first.force
    reading = first.reading
    if form == "turned":
        force = -force
    if form == "shuffled":
        force = source.permutation(force)
    if form == "another device":
        reading = other.reading
    if form == "five rows":
        force = force[5:]
        reading = reading[:-5]
    if form == "scaled":
        force = 1e-3 * force
    return force, reading, first.period


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 30, 59])
def test_no_refusal_is_about_signs_or_excitation_if_least_squares_explain_the_log_to_a_tenth(seed, tmp_path):
    """Of logs with friction, drifts and hands, and of such that mean nothing, which are refused."""
    source = np.random.default_rng(seed)
    form = FORMS[seed % len(FORMS)]
    force, reading, period = log_of(source, form)
    file = tmp_path / "log.csv"
    table = np.stack([period * np.arange(len(force)), force, reading], axis=1)
    np.savetxt(file, table, "%.12g", ",", header="time,force,position", comments="")
    refused = ""
    try:
        wavesweep.identify(str(file))
    except UsageError as error:
        refused = str(error)
    assert not refused or unexplained(force, reading, period) > 0.1, refused


@pytest.mark.parametrize(
    ("delay", "expected"), [(1100.0, "at most half of the rows, 500 ticks"), (-1000.0, "a number from 1e-30 to 1e\\+30, or 0")]
)
def test_a_delay_beyond_the_log_is_refused(delay, expected, tmp_path):
    path = tmp_path / "log.csv"
    rows = np.c_[np.arange(1000) / 1000, np.sin(np.arange(1000) / 9), np.sin(np.arange(1000) / 11)]
    np.savetxt(path, rows, delimiter=",", header="time,force,position", comments="")
    with pytest.raises(UsageError, match=rf"--delay: expected {expected}, found {delay:g}"):
        wavesweep.identify(path, delay=delay)
