"""The record of a simulation: signals and energies per tick, the table of both, and the response of settled sines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.simulation.inputs import Tone
from wavesweep.errors import UsageError

_MOTION = ("f_h", "x", "v", "x_hat", "v_hat", "f_m", "f_device")
_WAVES = ("u_m", "v_m", "u_s", "v_s", "x_s", "x_dot_s", "F_s", "u_h", "v_l", "v_2")
_ENERGIES = ("hand", "device", "user", "slow", "local", "channel")
_FAST = ("f_m", "touching", "u_m", "v_m", "u_h", "v_l", "v_2")
_AVATAR = {"v_s": "v", "x_s": "x", "x_dot_s": "x_dot", "F_s": "F"}
_SAME = 1e-9  # rad per tick: images closer than this are one column


@dataclass(frozen=True)
class Energy:
    """Energies (J) since the start, at the end of every tick, shape ``(ticks,)`` each.

    `hand`: work of the hand on the device, ``Σ f_h·Δx``. `device`: work that the device's motors took up, ``Σ f_d·Δx``.
    Wave power is ``(u² - v²)/2``, and a wave lasts its own period: `user` went into the channel at the user's side,
    ``Σ T·(u_m² - v_m²)/2``; `slow` came out at the slow environment, ``Σ T_s·(u_s² - v_s²)/2``, booked at its update;
    `local` came out at the local model. `channel` is the rest, ``user - slow - local``: stored or dissipated while
    it is positive, made up by aliasing, by the Kp term or by results that are held too long where it is negative.
    The last four are None without waves. Periods are the nominal ones, also where the ticks jitter.
    """

    hand: np.ndarray
    device: np.ndarray
    user: np.ndarray | None
    slow: np.ndarray | None
    local: np.ndarray | None
    channel: np.ndarray | None


@dataclass(frozen=True)
class Simulation:
    """A simulated experiment.

    `signals`: the columns, read-only, an entry per fast tick, SI units. Always: `time` the tick's start, `f_h` the
    hand's force, `x` and `v` the motion, `x_hat` and `v_hat` as measured, `f_m` the controller's force, `f_device` what
    the motors make of it, `touching` whether the held slow result is of a contact. With waves: `u_m`, `v_m`, and the
    last slow update's `u_s`, `v_s`, `x_s`, `x_dot_s`, `F_s`, repeated until the next; with a local model behind
    them `u_h`, `v_l`, `v_2`. `F_s` also without waves.
    `energy`: see `Energy`. `frame`: ticks in a frame, 1 for `dc`.
    `late`: ticks by which each frame's slow result was late, -1 for one that was lost.
    `finite`: how many ticks passed before a number left the range of doubles; all of them unless the loop is unstable.
    """

    signals: Mapping[str, np.ndarray]
    energy: Energy
    late: np.ndarray
    frame: int
    finite: int


def signals_of(rows: list, force: np.ndarray, lengths: np.ndarray) -> dict[str, np.ndarray]:
    """Turn rows into columns; signals that a controller does not have are left out."""
    names = ("x", "v", "x_hat", "v_hat", "f_device")
    columns = {"time": np.concatenate([[0.0], np.cumsum(lengths)])[: len(rows)], "f_h": force}
    columns |= {name: np.array([row[place] for row in rows]) for place, name in enumerate(names)}
    seen = [row[-1] for row in rows]
    columns |= {name: np.array(found) for name in _FAST if (found := _found(seen, name))}
    for name in ("u_s", "F_s"):
        columns |= _held(name, [getattr(signals, name, None) for signals in seen])
    avatars = [getattr(signals, "slow", None) for signals in seen]
    for name, field in _AVATAR.items():
        columns |= _held(name, [avatar and getattr(avatar, field) for avatar in avatars])
    return columns


def _found(seen: list, name: str) -> list:
    """Give a signal of every tick, nothing where the controller does not have it."""
    return [getattr(signals, name) for signals in seen] if seen and getattr(seen[0], name, None) is not None else []


def _held(name: str, numbers: list) -> dict[str, np.ndarray]:
    """Repeat the number of each slow update until the next; the first tick is one, where there are any at all."""
    updates = np.array([k for k, number in enumerate(numbers) if number is not None], dtype=int)
    if not len(updates):
        return {}
    known = np.array([numbers[k] for k in updates])
    return {name: np.repeat(known, np.diff(updates, append=len(numbers)))}


def energies(signals: dict[str, np.ndarray], moved: np.ndarray, T: float, ratio: int) -> Energy:
    """Add up the energies of a simulation.

    Parameters: `signals` the columns of the simulation, `moved` the change of position in each tick (m), `T` the
    nominal tick (s), `ratio` of slow to fast period.

    Accuracy: rounding of the sums; an overflowed simulation gives infinities or NaN.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        hand, device = (np.cumsum(signals[name] * moved) for name in ("f_h", "f_device"))
        if "u_m" not in signals:
            return Energy(hand, device, None, None, None, None)
        user = np.cumsum(_wave(signals, "u_m", "v_m", T))
        updates = np.arange(len(moved)) % ratio == 0
        slow = np.cumsum(np.where(updates, _wave(signals, "u_s", "v_s", ratio * T), 0.0))
        local = np.cumsum(_wave(signals, "u_h", "v_l", T)) if "u_h" in signals else np.zeros_like(user)
        return Energy(hand, device, user, slow, local, user - slow - local)


def _wave(signals: dict[str, np.ndarray], going: str, coming: str, period: float) -> np.ndarray:
    """Energy (J) that a pair of waves carries away in each period."""
    return period * (signals[going] ** 2 - signals[coming] ** 2) / 2


def table(simulation: Simulation) -> dict[str, np.ndarray]:
    """Give the columns of the table `simulate`, a row per fast tick, in SI units.

    The columns do not depend on the controller: signals that it does not have are NaN throughout. Slow signals hold the last
    update. The rows end before the first tick in which a number leaves the range of doubles.
    """
    signals, frame = simulation.signals, simulation.frame
    ticks = np.arange(len(signals["x"]))
    missing = np.full(len(ticks), np.nan)
    energies = {f"energy_{name}": getattr(simulation.energy, name) for name in _ENERGIES}
    columns = {"tick": ticks, "frame": ticks // frame, "phase": ticks % frame, "time_s": signals["time"]}
    columns |= {name: signals.get(name, missing) for name in _MOTION}
    columns["touching"] = signals.get("touching", np.zeros(0, dtype=bool))  # without a tick nothing was seen at all
    columns["late"] = np.repeat(simulation.late, frame)[: len(ticks)]
    columns |= {name: signals.get(name, missing) for name in _WAVES}
    columns |= {name: missing if column is None else column for name, column in energies.items()}
    whole = _finite_rows([column for column in columns.values() if column is not missing], len(ticks))
    return {name: column[:whole] for name, column in columns.items()}


def _finite_rows(columns: list[np.ndarray], rows: int) -> int:
    """Give how many rows come before the first number that is infinite or none."""
    finite = np.ones(rows, dtype=bool)
    for column in columns:
        finite &= np.isfinite(column)
    return rows if finite.all() else int(finite.argmin())


def estimate(signals: Mapping[str, np.ndarray], tones: Sequence[Tone], fast_hz: float, ratio: int) -> dict[str, np.ndarray]:
    """Estimate the transmitted admittance ``x/f_h`` and impedance ``f_device/x`` at each tone's frequency.

    A multirate loop answers a sine also at its images ``f + n·f_slow``. Each signal of a stretch is fitted with sines
    at the frequency, at its images and a constant (drift), and only the component at the frequency itself is kept;
    left out, the images would leak into it wherever the stretch is no whole number of frames.

    Parameters: `signals` with the columns `f_h`, `x`, `f_device` (see `Simulation.signals`), `tones` the stretches to
    use, `fast_hz` the fast rate, `ratio` ticks in a frame (1 for `dc`).

    Returns the columns ``frequency_hz``, ``omega_Ts`` (radians per slow sample), ``admittance_re``, ``_im``, ``_abs``
    (m/N), ``_deg``, and ``impedance_…`` likewise (N/m), an entry per tone.

    Errors: `UsageError` for a stretch with fewer ticks than the fit has unknowns.

    Accuracy: rounding, once the loop has settled. At multiples of half the slow rate the sine is its own image: there a
    single record depends on the phase of the sine against the slow clock, in an experiment as here.
    """
    found = np.array([_components(signals, tone, fast_hz, ratio) for tone in tones], dtype=complex).reshape(-1, 3)
    f_h, x, f_device = found.T
    frequency = np.array([tone.frequency_hz for tone in tones])
    columns = {"frequency_hz": frequency, "omega_Ts": 2 * np.pi * frequency * ratio / fast_hz}
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing moved, or nothing pushed: NaN says so
        responses = {"admittance": x / f_h, "impedance": f_device / x}
    for name, response in responses.items():
        columns[f"{name}_re"], columns[f"{name}_im"] = response.real, response.imag
        columns[f"{name}_abs"], columns[f"{name}_deg"] = np.abs(response), np.degrees(np.angle(response))
    return columns


def _components(signals: Mapping[str, np.ndarray], tone: Tone, fast_hz: float, ratio: int) -> list[complex]:
    """Fit the complex amplitudes at the tone's frequency."""
    basis = _basis(2 * np.pi * tone.frequency_hz / fast_hz, ratio, np.arange(tone.first, tone.last))
    if basis.shape[0] < basis.shape[1]:
        raise UsageError(
            f"tone of {tone.frequency_hz} Hz: expected at least {basis.shape[1]} ticks to tell it from its images, "
            f"found {basis.shape[0]}; measure longer"
        )
    measured = np.stack([signals[name][tone.first : tone.last] for name in ("f_h", "x", "f_device")], axis=1)
    cosine, sine = np.linalg.lstsq(basis, measured, rcond=None)[0][:2]
    return list(cosine - 1j * sine)


def _basis(omega: float, ratio: int, k: np.ndarray) -> np.ndarray:
    """Give cosines and sines at ``omega`` (first) and at its images, each frequency once, and a constant."""
    images = omega + 2 * np.pi * np.arange(ratio) / ratio
    folded = np.abs((images + np.pi) % (2 * np.pi) - np.pi)
    columns, seen = [], [0.0]
    for image in folded:
        if min(abs(image - other) for other in seen) > _SAME:
            seen.append(image)
            columns += [np.cos(image * k)] if abs(image - np.pi) <= _SAME else [np.cos(image * k), np.sin(image * k)]
    return np.stack([*columns, np.ones(len(k))], axis=1)
