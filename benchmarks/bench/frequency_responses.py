"""Run time against error for frequency responses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

import wavesweep
from bench.measuring import Patience, Row, at_first_too
from bench.problems import checked, digest, load_paper, references
from wavesweep import Spec
from wavesweep.engine._response import steady
from wavesweep.engine._response.lifted import over_frame
from wavesweep.program.analyses.spec_loops import loop_at_hand

PART = "response"
CHECKED = 10  # frequencies of each request that the references know


@dataclass(frozen=True, eq=False)
class ResponseProblem:
    """Admittance of one loop at many frequencies; sizes: their numbers."""

    spec: Spec
    sizes: tuple[int, ...] = (500, 50_000)

    def frequencies(self, size: int) -> np.ndarray:
        """Hz, logarithmic, up to the slow rate for the smallest request and to the fast Nyquist frequency for others."""
        return np.geomspace(0.1, 50 if size == min(self.sizes) else 499, size).round(9)

    def checked(self, size: int) -> list[float]:
        """The frequencies whose response is known to 50 digits."""
        return self.frequencies(size)[:: size // CHECKED].tolist()


def problem() -> ResponseProblem:
    """The loop of the paper's Figure 6."""
    return ResponseProblem(load_paper("fig6"))


def rows(patience: Patience, *, quick: bool) -> Iterator[Row]:
    """Measure every method at every size; quick: at the smallest."""
    asked = problem()
    known = checked(references()["responses"], digest(asked.spec), "the responses")["values"]
    for size in asked.sizes[:1] if quick else asked.sizes:
        frequency = asked.frequencies(size)
        step = size // CHECKED
        exact = np.array([complex(re, im) for re, im, *_ in known[str(size)]])
        own = partial(admittance, asked.spec, frequency)
        for name, respond in METHODS.items():
            answers: list[np.ndarray] = []
            respond(asked.spec, frequency[:2])  # warm
            pair, at_first = at_first_too(lambda: answers.append(respond(asked.spec, frequency)), own, patience)  # noqa: B023 - called here
            error = np.abs(answers[-1][::step] / exact - 1)
            yield at_first | {
                "part": PART, "problem": asked.spec.name, "method": name, "setting": f"{size} frequencies", "size": size,
                "seconds": pair.first, "seconds_each": pair.first / size, "ratio": pair.ratio, "pairs": pair.pairs,
                "yardstick": OURS, "error_max": error.max(), "error_median": np.median(error),
            }  # fmt: skip


def admittance(spec: Spec, frequency: np.ndarray) -> np.ndarray:
    """This tool: both rates connected, their modes, and the response; impedance comes with it."""
    return steady.respond(loop_at_hand(spec), frequency).admittance


def everything(spec: Spec, frequency: np.ndarray) -> np.ndarray:
    """This tool: the whole table, with worst-case gain and verdict, as a DataFrame."""
    table = wavesweep.compile(spec).response(frequency)
    return (table.admittance_re + 1j * table.admittance_im).to_numpy()


def batched(spec: Spec, frequency: np.ndarray) -> np.ndarray:
    """numpy: a batched solve with the lifted system; its position is a state."""
    (E, B, C, D), z, turns = _lifted(spec, frequency)
    found = []
    for some in np.array_split(np.arange(z.size), -(-z.size // 5000)):
        force = turns[some].conj()
        state = np.linalg.solve((z[some, None, None] - 1) * np.eye(len(E)) - E, (force @ B.T)[..., None])
        found.append((turns[some] * (state[..., 0] @ C.T + force @ D.T)).mean(-1))
    return np.concatenate(found)


def batched_with_gain(spec: Spec, frequency: np.ndarray) -> np.ndarray:
    """numpy: a batched solve for all ticks and the largest singular values, the slow part of the whole table."""
    (E, B, C, D), z, turns = _lifted(spec, frequency)
    found = []
    for some in np.array_split(np.arange(z.size), -(-z.size // 5000)):
        state = np.linalg.solve((z[some, None, None] - 1) * np.eye(len(E)) - E, B + 0j)
        G = C @ state + D
        np.linalg.svd(G, compute_uv=False)
        found.append((turns[some, None] @ G @ turns[some, :, None].conj())[:, 0, 0] / turns.shape[1])
    return np.concatenate(found)


def controlled(spec: Spec, frequency: np.ndarray) -> np.ndarray:
    """python-control: the frequency response of the lifted system, M by M, summed over the frame's ticks."""
    system = wavesweep.compile(spec).to_control()
    _, z, turns = _lifted(spec, frequency)
    found = []
    for some in np.array_split(np.arange(z.size), -(-z.size // 5000)):
        G = system(z[some], squeeze=False)
        found.append(np.einsum("wi,ijw,wj->w", turns[some], G, turns[some].conj()) / turns.shape[1])
    return np.concatenate(found)


def _lifted(spec: Spec, frequency: np.ndarray):
    """E, B, C and D of the lifted loop, z of the frame, and `exp(-j w i T)` of every tick, `(points, ticks)`."""
    values = spec.values
    M = values["rates.ratio"]
    angle = 2j * np.pi * frequency / values["rates.fast_hz"]
    return over_frame(loop_at_hand(spec).port, M, positions=True), np.exp(angle * M), np.exp(-angle[:, None] * np.arange(M))


OURS = "this tool, two responses alone"
METHODS = {
    OURS: admittance,
    "this tool, the whole table": everything,
    "numpy, batched solve": batched,
    "numpy, batched solve and worst gain": batched_with_gain,
    "python-control": controlled,
}
