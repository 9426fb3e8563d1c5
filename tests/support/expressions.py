"""Random factors with peaks, poles and steps of any width, as texts of a spec and as functions."""

from dataclasses import dataclass

import numpy as np

WIDTHS = -4.5, -0.5  # powers of ten of the range, of what a peak or a step is wide
BESIDE = 0.0, 0.5, -0.5, 1.0, -1.0, 3.0  # widths from its middle, where members are looked for


@dataclass(frozen=True)
class Expression:
    """A factor, 1 away from what is narrow: its text in q, its value, the range of q, and places next to what is narrow."""

    text: str
    at: object
    span: tuple[float, float]
    places: tuple[float, ...]

    def q(self, rng):
        """A value in the range, mostly next to what is narrow."""
        low, high = self.span
        if rng.random() < 0.3:
            return float(rng.choice([low, high, rng.uniform(low, high)]))
        return float(np.clip(rng.choice(self.places), low, high))


def expression(rng):
    """A random factor, up to three times as large or almost 0 where it peaks."""
    kind = str(rng.choice(["lorentz", "lorentz", "spike", "gauss", "pole", "step", "pulses", "corner", "matched", "decades"]))
    low, width = float(rng.choice([0.0, 1.0, -2.0])), float(10 ** rng.uniform(0, 2))
    high, h = low + width, float(rng.choice([-0.95, 0.5, 1.0, 2.0]))
    w, c = width * float(10 ** rng.uniform(*WIDTHS)), float(rng.uniform(low, high))
    match kind:
        case "lorentz":
            text = f"{h * w**2!r}/((q - {c!r})**2 + {w**2!r})"
        case "spike":
            text = f"{h * w!r}/sqrt((q - {c!r})**2 + {w**2!r})"
        case "gauss":
            text = f"{h!r}*exp(-((q - {c!r})/{w!r})**2)"
        case "pole":  # next to the range
            c, sign = (low - w, 1) if rng.random() < 0.5 else (high + w, -1)
            text = f"{sign * h * w!r}/(q - {c!r})"
        case "step":
            w = max(w, width / 600)  # so that the exponential is a double
            text = f"{h!r}/(1 + exp(({c!r} - q)/{w!r}))"
        case "pulses":
            a, turn = float(10 ** rng.uniform(1, 4)), 2 * np.pi / (width * float(10 ** rng.uniform(-2, 0)))
            c, w = low + float(rng.integers(0, 40)) * np.pi / turn, 1 / (turn * a**0.5)
            text = f"{h!r}*exp(-{a!r}*(1 - cos({turn!r}*(q - {c!r}))))"
        case "corner":
            text = f"{h / width!r}*sqrt((q - {c!r})**2 + {w**2!r})"
        case "matched":  # the power into a load, most where it is as large as that of the source
            c = low
            text = f"{4 * h * w!r}*(q - {low - w!r})/(q - {low - 2 * w!r})**2"
        case _:
            low, high = 1e-3, float(10 ** rng.uniform(-2, 7))
            c = w = float(np.exp(rng.uniform(np.log(low), np.log(high))))
            text = f"{4 * h * c!r}*q/(q + {c!r})**2"
    text = "1 + " + text.replace("--", "+")
    at = eval(f"lambda q: {text}", {name: getattr(np, name) for name in ("sqrt", "exp", "cos")})  # noqa: S307 - its own text
    return Expression(text, at, (low, high), tuple(float(c + step * w) for step in BESIDE))
