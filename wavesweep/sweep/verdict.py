"""The verdict on a spec's own design: stability, the room that each number has, and the feel."""

import numpy as np

from wavesweep.analysis.response import felt, felt_map, prepare, respond
from wavesweep.analysis.spectrum import eigenvalues
from wavesweep.diagram import WALL, draw, keys_read
from wavesweep.errors import WavesweepError
from wavesweep.lifted import close, cut_at_wall
from wavesweep.spec import SYMBOLS, Axis, Spec
from wavesweep.sweep.assumptions import assumes
from wavesweep.sweep.grid import make_grid
from wavesweep.sweep.job import job_over
from wavesweep.sweep.running import in_memory

FAR = 10.0  # factor up to which a number is followed
USUAL = {"K_VE": 1000.0, "B_VE": 10.0, "Kp": 20.0, "K_LM": 1000.0, "B_LM": 10.0}  # followed up to FAR times that, from 0
DELAYS = 200  # ticks of delay that are tried
SLOW_SHARE = 1e-4  # of the slow rate: a frequency so low that the impedance is that of a spring and a damper


def verdict(spec: Spec) -> dict:
    """The verdict on the spec's own design as a JSON-able dict; a missing number is None.

    stable, spectral_radius (per frame), period_s (of the frame), assumes (see `assumptions`); limits: per number of the loop
    the stable interval that its value lies in (see `limits`); delay: the number of ticks it may grow to; felt: stiffness
    (N/m) and damping (N*s/m) of the wall as the hand feels it at low frequency; slowest: time constant (s) and damping
    ratio of the slowest mode; channel_norm: of the wave channel, 1 or less if it is passive.
    """
    values = spec.values
    cut = cut_at_wall(draw(values))
    K, B = (values[path] for path in WALL)
    delta = eigenvalues(close(cut, K, B))[0]
    radius = float(np.abs(1 + delta).max(initial=0.0))
    found = {"stable": radius < 1, "spectral_radius": radius, "period_s": float(cut.period), "assumes": assumes(spec)}
    found |= {"limits": limits(spec, cut), "delay": _delays(spec)}
    return found | {"felt": _felt(spec), "slowest": _slowest(delta, float(cut.period)), "channel_norm": _channel_norm(values)}


def limits(spec: Spec, cut=None) -> list[dict]:
    """For each symbol that the loop reads: value, the ends of the stable interval about it, and the factors to them.

    low, high: None if the interval goes on to the end of the range that was searched (`from`, `to`): 0 or a tenth of the
    value, and ten times the value. intervals: all stable intervals in that range. certified: whether they are.
    """
    read = keys_read(spec.values)
    return [_limit(spec, name, path, cut) for name, path in SYMBOLS.items() if path in read]


def _limit(spec, name, path, cut):
    value = spec.values[path]
    span = (value / FAR if path not in WALL and value else 0.0, FAR * (value or USUAL.get(name, 1.0)))
    axis = Axis(name, path, (), *span, False, "linear")
    found = {"name": name, "value": value, "from": span[0], "to": span[1], "low": None, "high": None, "intervals": []}
    try:
        rows = in_memory(job_over(make_grid(spec, (), path), axis, cut))
    except WavesweepError as error:
        return found | {"stable": None, "doubt": str(error), "certified": False}
    inside = (rows["low"] <= value) & (value <= rows["high"])
    pairs = zip(rows["low"].tolist(), rows["high"].tolist(), strict=True)
    found["intervals"] = [list(pair) for pair, number in zip(pairs, rows["intervals"].tolist(), strict=True) if number]
    found |= {"stable": bool(inside.any()), "doubt": str(rows["doubt"][0]), "certified": bool(rows["certified"].all())}
    if not inside.any():
        return found
    row = int(np.flatnonzero(inside)[0])
    for end in ("low", "high"):
        if not np.isnan(rows[f"{end}_omega"][row]):
            found[end] = float(rows[end][row])
    return found


def _delays(spec):
    """The largest delay of the slow environment up to which every delay is stable, in ticks; none if the loop has none."""
    path = "environment.delay"
    if path not in keys_read(spec.values):
        return None
    now, ratio = spec.values[path], spec.values["rates.ratio"]
    most = None
    for delay in range(now, min(ratio, now + DELAYS) + 1):
        values = {**spec.values, path: delay}
        cut = cut_at_wall(draw(values))
        if np.abs(1 + eigenvalues(close(cut, *(values[key] for key in WALL)))[0]).max(initial=0.0) >= 1:
            break
        most = delay
    return {"ticks": now, "most": most, "frame": ratio, "tried": min(ratio, now + DELAYS)}


def _felt(spec):
    values = spec.values
    K, B = (values[path] for path in WALL)
    diagram = draw(values)
    stiffness = float(felt(felt_map(diagram), K))
    low = SLOW_SHARE * values["rates.fast_hz"] / values["rates.ratio"]
    impedance = respond(prepare(diagram, K, B), np.array([low, low / 2])).impedance.imag / (
        2 * np.pi * np.array([low, low / 2])
    )
    damping = (4 * impedance[1] - impedance[0]) / 3
    return {"stiffness": _number(stiffness), "damping": _number(damping)}


def _slowest(delta, period):
    """Of the mode that decays most slowly: s per factor e, damping ratio, and rad/s."""
    if not delta.size or np.abs(1 + delta).max() >= 1:
        return None
    slowest = delta[np.argmax(np.abs(1 + delta))]
    s = np.log1p(slowest) / period
    return {"time_constant_s": _number(-1 / s.real), "damping_ratio": _number(-s.real / abs(s)), "omega": _number(abs(s.imag))}


def _channel_norm(values):
    from wavesweep.analysis.passivity import channel_norm

    norm = channel_norm(values)
    return None if norm is None else _number(norm.norm)


def _number(value):
    return float(value) if np.isfinite(value) else None
