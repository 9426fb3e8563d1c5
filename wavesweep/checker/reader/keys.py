"""What each key may be: a number of a range, a whole one, or one of some words; of a controller and of each type of block."""

from fractions import Fraction
from typing import NamedTuple

from .loops import Unreadable

SIZES = Fraction(10) ** -60, Fraction(10) ** 60  # of numbers other than 0
# A rule is `number`, `> 0` or `>= 0`, perhaps up to a number, `whole` from one number up to another, or words.
CONTROLLER = """
rates.fast_hz > 0
rates.slow_hz > 0
rates.ratio whole 1 1000
device.preset paper touch omni desktop falcon omega sigma lambda
device.mass > 0
device.damping >= 0
device.velocity exact difference
device.delay whole 0 1000
device.dead_time >= 0
operator.mass >= 0
operator.damping >= 0
operator.stiffness >= 0
environment.K_VE >= 0
environment.B_VE >= 0
environment.integration explicit implicit trapezoidal
environment.delay whole 0
environment.step elapsed nominal
controller.kind dc dc-slow dc-lm dc-vc dc-vc-lm pmw pmw-mean pmw-lm
controller.b > 0
controller.Kp >= 0
controller.K_VC > 0
controller.B_VC > 0
local_model.K_LM >= 0
local_model.B_LM >= 0
local_model.integration explicit implicit trapezoidal
local_model.delay whole 0 1
filters.lp1.order whole 0 12
filters.hp.order whole 0 12
filters.lp2.order whole 0 12
"""
FILTER = """
cutoff_hz > 0
passband_hz > 0
stopband_hz > 0
passband_db > 0 300
stopband_db > 0 300
"""
LIMITS = """
high number
low number
anti_windup none back-calculation clamping
tracking_s > 0
"""
METHOD = "method explicit implicit trapezoidal\n"
PI = f"kp number\nki number\n{METHOD}{LIMITS}"
WALL = "K number\nB number\nlate whole 0 1000\nnx number\nny number\n"
BODY = "damping number\nstiffness number\n"
BLOCKS = {
    "mass": f"mass > 0\n{BODY}",
    "inertia": f"inertia > 0\n{BODY}",
    "mass_matrix": "axes list\nmass list\ndamping list\nstiffness list\nthrough list\n",
    "spring": "k number\nd number\n",
    "ss": "A list\nB list\nC list\nD list\ninputs list\noutputs list\ndiscrete flag\n",
    "tf": "num list\nden list\ndiscrete flag\n",
    "gain": "k number\n",
    "saturation": "high number\nlow number\n",
    "delay": "steps whole 0 1000\nseconds >= 0\ntaps list\n",
    "hold": "",
    "impulse": "",
    "channel": """
late whole 0 1000
lost whole 0 100
missing held zero
loss >= 0 1
burst >= 0 1
burst_end >= 0 1
burst_loss >= 0 1
""",
    "difference": "",
    "integrator": f"{METHOD}{LIMITS}",
    "butterworth": "order whole 0 12\ncutoff_hz > 0\npass low high\n",
    "lowpass": "a > 0 1\ncutoff_hz > 0\n",
    "pi": PI,
    "pid": f"{PI}kd number\ntau >= 0\n",
    "lead": "zero_hz > 0\npole_hz > 0\n",
    "notch": "frequency_hz > 0\nq > 0\ndepth >= 0\n",
    "biquad": "b0 number\nb1 number\nb2 number\na1 number\na2 number\n",
    "fir": "coefficients list\n",
    "mean": "n whole 1 1000\n",
    "wave": "b > 0\ngives force velocity\n",
    "avatar": "b > 0\nintegration explicit implicit trapezoidal\n",
    "local_model": "b > 0\nK number\nB number\nintegration explicit implicit trapezoidal\n",
    "wall": WALL,
    "wall-3d": f"{WALL}nz number\n",
}


class Rule(NamedTuple):
    """low, high: ends of the range, None without one. words: if it is no number."""

    words: tuple[str, ...] = ()
    whole: bool = False
    low: Fraction | None = None
    above: bool = False
    high: Fraction | None = None

    def refuse(self, path: str, entry, arithmetic) -> None:
        """Raise Unreadable for a value that is none of these, or a range of which an end is none."""
        if self.words:
            kind = {"list": list, "flag": bool}.get(self.words[0], str)
            if not isinstance(entry, kind) or (kind is str and entry not in self.words):
                raise Unreadable(
                    f"{path} = {entry!r} is not known: expected {' or '.join(self.words)}"
                )
            return
        if isinstance(entry, str | bool | list | dict):
            raise Unreadable(f"{path} = {entry!r} is not a number")
        low, high = arithmetic.ends(entry)
        if self.whole and (low != high or low % 1):
            raise Unreadable(f"{path} = {float(low):g} has to be a whole number")
        if self.low is not None and (low < self.low or (self.above and low == self.low)):
            raise Unreadable(
                f"{path} = {float(low):g} is not {'above' if self.above else 'at least'} {self.low}"
            )
        if self.high is not None and high > self.high:
            raise Unreadable(f"{path} = {float(high):g} is not at most {self.high}")
        if any(end and not SIZES[0] <= abs(end) <= SIZES[1] for end in (low, high)):
            raise Unreadable(f"{path} is not of a size from 1e-60 to 1e60, or 0")


def rules(text: str) -> dict[str, Rule]:
    """The rule of each key of a table above."""
    rules_of_keys = {}
    for line in text.split("\n"):
        name, *words = line.split() or [""]
        match words:
            case ["number"]:
                rules_of_keys[name] = Rule()
            case [">" | ">=" as sign, low, *high]:
                rules_of_keys[name] = Rule(
                    (), False, Fraction(low), sign == ">", *map(Fraction, high)
                )
            case ["whole", low, *high]:
                rules_of_keys[name] = Rule((), True, Fraction(low), False, *map(Fraction, high))
            case [_, *_]:
                rules_of_keys[name] = Rule(tuple(words))
    return rules_of_keys
