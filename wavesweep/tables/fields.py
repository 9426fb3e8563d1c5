"""The columns of all tables: name, kind, unit and meaning of each. It loads no numpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from wavesweep.doubts import OF_DERIVATIVES, OF_INTERVALS, OF_MARGINS, OF_RESPONSES

if TYPE_CHECKING:
    import numpy as np

    from wavesweep.columns import Columns

FieldKind = Literal["number", "integer", "boolean", "string"]
OF_ALONG, OF_WALL = "that of along", "that of the wall"  # units that the run decides
ENDS = ("low", "high")


@dataclass(frozen=True)
class Field:
    """One column.

    unit: "1" if dimensionless, "" if none applies, `OF_ALONG` or `OF_WALL`. optional: only some tables of the kind have it.
    derived: computes the column from the others, `(rows,)`, if it does not come with them. values: the meaning of each of its
    words, if it holds words of this program. advice: what a reader of the column can do, as a sentence or two.
    """

    name: str
    kind: FieldKind
    unit: str
    description: str
    optional: bool = False
    derived: Callable[[Columns], np.ndarray] | None = None
    values: Mapping[str, str] = field(default_factory=dict, hash=False)
    advice: str = ""


def _parts(name: str, unit: str, what: str) -> tuple[Field, ...]:
    """The columns of a complex number."""
    words = {"re": "real part", "im": "imaginary part", "abs": "magnitude", "deg": "phase"}
    units = dict.fromkeys(words, unit) | {"deg": "deg"}
    return tuple(Field(f"{name}_{part}", "number", units[part], f"{what}, {word}") for part, word in words.items())


def _doubt(why: str, words: tuple[str, ...], otherwise: str) -> Field:
    advice = "`wavesweep explain WORD` says what each word means and what helps."
    return Field("doubt", "string", "", f"{why}: {', '.join(words)}; {otherwise}", advice=advice)


# Of intervals.
ALONG = Field("along", "string", "", "name of the axis that the intervals lie on")
FOUND = (
    Field("intervals", "integer", "1", "number of stable intervals of this combination"),
    Field("interval", "integer", "1", "number of this interval, from 0"),
    Field("low", "number", OF_ALONG, "lower end of the stable interval, clipped to the swept range"),
    Field("high", "number", OF_ALONG, "upper end of the stable interval, clipped to the swept range"),
    Field("low_omega", "number", "rad/s", "oscillation that starts at low; missing where the range ends it"),
    Field("high_omega", "number", "rad/s", "oscillation that starts at high; missing where the range ends it"),
    Field(
        "certified",
        "boolean",
        "",
        "ends and label are verified, no crossing inside can have been missed",
        advice="Rely on rows with 1. Of a row with 0 the column doubt gives the reason, and what is not known is missing.",
    ),
    Field("residual", "number", "1", "largest relative residual of the characteristic equation at the ends"),
    _doubt("why the row is not certified", OF_INTERVALS, "empty where it is"),
)
FELT = tuple(
    Field(
        f"felt_{end}",
        "number",
        OF_WALL,
        f"static stiffness that the hand feels at {end}; missing without an interval",
        advice="Waves give way, so that a stiff wall may feel soft: a gain Kp or a larger b brings it nearer to K_VE.",
    )
    for end in ENDS
)
LINES = tuple(
    Field(
        f"{end}_hz",
        "number",
        "Hz",
        f"strongest line that a spectrum shows, of all images of {end}_omega; missing without",
        advice="Compare it with the frequency at which your device begins to buzz.",
    )
    for end in ENDS
)
HAND = Field(
    "hand",
    "string",
    "",
    "whose hand the row is for: free, operator, passive, box, port or channel",
    values={
        "free": "the device alone, without a hand",
        "operator": "the spec's own operator",
        "passive": "every passive hand, of any mass and stiffness, also if it moves within a tick",
        "box": "every hand between a fingertip and an arm, or in the ranges that --for-hands box:... gives",
        "port": "the hand's port is passive, if forces are held over a tick",
        "channel": "the wave channel adds at most the tolerance of the run to its waves",
    },
)
ABOUT_ENDS = (
    *(
        Field(f"{end}_hand_{part}", "number", unit, f"{part} of the hand that sets {end}; missing where none does", True)
        for end in ENDS
        for part, unit in (("mass", "kg"), ("damping", "N*s/m"), ("stiffness", "N/m"))
    ),
    Field(
        "settled",
        "boolean",
        "",
        "the interval holds for every hand that the row is for: for a box proved but for a thousandth of the interval at "
        "either end, where a search found no hand that it does not hold for; else as certified",
        optional=True,
        advice="Of a row with 0, a hand that the search missed may be unstable: make the box smaller to have it proved.",
    ),
)
FOR_ALL = (
    Field(
        "guarantee",
        "string",
        "",
        "spec: of the spec's own numbers; for_all: proved for all numbers of [for_all], or all messages, from low to high; "
        "mean_square: proved in mean square, with messages lost at random",
        optional=True,
        values={
            "spec": "the spec's own numbers",
            "for_all": "all numbers of [for_all]",
            "mean_square": "messages lost at random",
        },
    ),
    *(
        Field(name, "number", OF_ALONG, f"nearest value {side} that numbers of [for_all] refute; missing without", True)
        for name, side in (("fails_below", "below low"), ("fails_from", "beyond high"))
    ),
    Field(
        "settled",
        "boolean",
        "",
        "what is proved comes within 1 % of what is refuted, or of the swept range, at both ends; near an end of 0 within a "
        "ten-thousandth of the other end (for ranges beside frames that vary a thousandth)",
        True,
        advice="Rely on low to high in any case; between high and fails_from nothing is known. Narrower ranges settle it.",
    ),
    Field(
        "counterexample",
        "string",
        "",
        "the numbers with which it is unstable beyond fails_from, and below fails_below",
        True,
        advice="Give them to simulate with --set (a pattern of frames as simulate.frames), and see the loop grow.",
    ),
)
LEFT_OPEN = Field(
    "left_open",
    "string",
    "",
    "what was neither proved nor refuted next to the proof: a share, and the numbers within which it lies",
    True,
    advice="Narrow these ranges, or prove them in parts.",
)
INTERVALS = (ALONG, *FOUND, *FELT, *FOR_ALL, *LINES, LEFT_OPEN)
INTERVALS_FOR_HANDS = (ALONG, HAND, *FOUND, *ABOUT_ENDS, *FELT, *LINES)

# Of responses.
DOUBT = _doubt("why the row is not vouched for", OF_RESPONSES, "empty where it is")
BODE = (
    Field("spec", "string", "", "file stem of the spec"),
    Field("controller", "string", "", "controller kind"),
    Field("frequency_hz", "number", "Hz", "frequency of the hand force"),
    Field("omega_Ts", "number", "rad", "normalised frequency, radians per sample of the slow rate, or of the slowest block"),
    *_parts("admittance", "m/N", "transmitted admittance"),
    *_parts("impedance", "N/m", "transmitted impedance"),
    Field("worst_gain", "number", "m/N", "largest singular value of the lifted response"),
    Field("stable", "boolean", "", "every eigenvalue but drift is inside the unit circle"),
    Field("admittance_error", "number", "1", "bound on the relative error of the admittance; missing with it"),
    Field("impedance_error", "number", "1", "bound on the relative error of the impedance; missing with it"),
    Field("worst_gain_error", "number", "1", "bound on the relative error of worst_gain; missing with it"),
    DOUBT,
)
_SPEC, _, _FREQUENCY, _OMEGA = BODE[:4]
_STABLE, _IN_UNIT = BODE[13], "in the unit of the row"
BODE_PORTS = (
    _SPEC,
    Field("from_input", "string", "", "input of the drawn loop"),
    Field("to_output", "string", "", "output of the drawn loop"),
    Field("unit", "string", "", "unit of the response, that of the output over that of the input; empty if one is not known"),
    replace(_FREQUENCY, description="frequency of the input, which is held over each tick"),
    _OMEGA,
    Field("response_re", "number", "", f"component of the output at this frequency over the input, real part, {_IN_UNIT}"),
    Field("response_im", "number", "", f"response, imaginary part, {_IN_UNIT}"),
    Field("response_abs", "number", "", f"response, magnitude, {_IN_UNIT}"),
    Field("response_deg", "number", "deg", "response, phase"),
    _STABLE,
    Field("response_error", "number", "1", "bound on the relative error of the response; missing with it"),
    DOUBT,
)
COMPARE = (_SPEC, *INTERVALS)

# Of simulations.
TICKS = (
    Field("tick", "integer", "tick", "number of the fast tick, from 0"),
    Field("frame", "integer", "1", "number of the slow frame, from 0; for dc, whose frame is one tick, the tick"),
    Field("phase", "integer", "tick", "tick in the frame; the slow event happens at 0"),
    Field("time_s", "number", "s", "when the tick starts"),
)
_SIGNALS = (
    Field("f_h", "number", "N", "force of the hand, held over the tick"),
    Field("x", "number", "m", "position of the device at the start of the tick"),
    Field("v", "number", "m/s", "velocity of the device at the start of the tick"),
    Field("x_hat", "number", "m", "position as the encoder gives it"),
    Field("v_hat", "number", "m/s", "velocity as it is measured"),
    Field("f_m", "number", "N", "force that the controller asks for"),
    Field("f_device", "number", "N", "force that the motors exert, held over the tick"),
    Field("touching", "boolean", "", "the slow result that the fast loop holds is of a contact with the wall"),
    Field("late", "integer", "tick", "by how much the slow result of this frame comes late; -1 where it never comes"),
    Field("u_m", "number", "W^(1/2)", "wave that leaves the user's side; NaN without waves"),
    Field("v_m", "number", "W^(1/2)", "wave that reaches the user's side; NaN without waves"),
    Field("u_s", "number", "W^(1/2)", "wave at the slow environment, held from its event on; NaN without waves"),
    Field("v_s", "number", "W^(1/2)", "wave that the slow environment returns, held likewise; NaN without waves"),
    Field("x_s", "number", "m", "position of the avatar, held likewise; NaN without waves"),
    Field("x_dot_s", "number", "m/s", "velocity of the avatar, held likewise; NaN without waves"),
    Field("F_s", "number", "N", "force of the virtual environment, held from its event on"),
    Field("u_h", "number", "W^(1/2)", "wave at the local model; NaN but for pmw-lm"),
    Field("v_l", "number", "W^(1/2)", "wave that the local model returns; NaN but for pmw-lm"),
    Field("v_2", "number", "W^(1/2)", "the local model's part of v_m; NaN but for pmw-lm"),
    Field("energy_hand", "number", "J", "work of the hand on the device up to the end of the tick"),
    Field("energy_device", "number", "J", "work that the motors took up, up to the end of the tick"),
    Field("energy_user", "number", "J", "energy that went into the wave channel at the user's side; NaN without waves"),
    Field("energy_slow", "number", "J", "energy that came out at the slow environment; NaN without waves"),
    Field("energy_local", "number", "J", "energy that came out at the local model; NaN without waves"),
    Field("energy_channel", "number", "J", "energy_user - energy_slow - energy_local; NaN without waves"),
)
# A drawn loop has those of its hand, if any, and its inputs, outputs and named signals behind the time.
SIMULATE = (*TICKS, *(replace(each, optional=True) for each in _SIGNALS))
_SEEN = BODE[:12]
# As seen in the simulation, beside what the linear analysis says of the same loop.
SIMULATE_RESPONSE = (
    *_SEEN,
    *(
        replace(each, name=f"linear_{each.name}", description=f"{each.description}, of the linear loop")
        for each in (*_SEEN[4:], *BODE[14:16])
    ),
    replace(DOUBT, description="why the linear response is not vouched for, or missing (unstable); empty where it is"),
)

# Of passivity.
PASSIVITY = (
    Field("channel_norm", "number", "1", "H-infinity norm of the wave channel; passive where it is at most 1"),
    Field("channel_omega", "number", "rad/s", "frequency of that norm"),
    Field("port_margin", "number", "m/N", "smallest eigenvalue of the Hermitian part, force to displacement"),
    Field("port_omega", "number", "rad/s", "frequency of that margin"),
    Field("channel_passive", "boolean", "", "the wave channel gives out no more energy than it takes in"),
    Field("port_passive", "boolean", "", "the whole loop gives the hand no more energy than it takes in"),
    Field("stable", "boolean", "", "the loop is stable with the spec's own operator"),
    Field("damping_needed", "number", "N*s/m", "further device damping that makes the port passive; missing if none is enough"),
)
PASSIVITY_FILTERS = (
    Field("lp1_order", "integer", "1", "Butterworth order of LP1, and of the high-pass to the local model"),
    Field("lp1_cutoff_hz", "number", "Hz", "-3 dB frequency of both"),
    *PASSIVITY[:2],
    Field(
        "excess",
        "number",
        "1",
        "channel_norm less 1: how far pmw is from passive",
        derived=lambda columns: columns["channel_norm"] - 1,
    ),
    Field(
        "energy_gain",
        "number",
        "1",
        "channel_norm^2 - 1: energy that aliasing can add to a wave, J per J, at most",
        derived=lambda columns: columns["channel_norm"] ** 2 - 1,
    ),
    Field("bank_norm", "number", "1", "norm of the way out of pmw-lm, with a high-pass of the same order and cutoff"),
    Field("certified", "boolean", "", "no frequency exceeds either norm by more than 1e-10, relative"),
    Field("sufficient_order", "number", "1", "least order at this cutoff within the run's tolerance; missing where none is"),
)

# Of limits and margins.
WHY = (
    ALONG,
    Field("interval", "integer", "1", "number of the stable interval, from 0"),
    Field("side", "string", "", "end of the interval: low or high; only ends that stability sets, and not the range"),
    Field(
        "crossing",
        "integer",
        "1",
        "number of the crossing at this end, from 0; the first one is the column low_omega or high_omega",
    ),
    Field("corner", "boolean", "", "several crossings lie within 1e-6 of this end, which moves with one of them"),
    Field("quantity", "string", "", "the limit: end, or felt, the static stiffness that the hand feels at this end"),
    Field("limit_value", "number", "", "value of the limit, in its unit"),
    Field("unit", "string", "", "unit of the limit"),
    Field("omega", "number", "rad/s", "frequency of the mode that crosses there, from frame to frame"),
    Field("damping_ratio", "number", "1", "its damping ratio a tenth of the end inside, half-way into a narrow interval"),
    Field("states", "string", "", "states that take part in this mode most, with their participation"),
    Field("number", "string", "", "name of a number that the loop reads"),
    Field("value", "number", "", "value of the number, in its unit"),
    Field("number_unit", "string", "", "unit of the number"),
    Field("elasticity", "number", "1", "per cent by which the limit moves for one per cent of the number; 0 if this is 0"),
    Field("slope", "number", "", "derivative of the limit by the number, in their units; missing if the number is 0"),
    Field("certified", "boolean", "", "the interval is certified, and rounding cannot change the derivatives by 1e-8"),
    _doubt("why the derivatives are missing", OF_DERIVATIVES, "empty if they are given"),
    Field("hz", "number", "Hz", "strongest line that a spectrum of the states shows of that mode, of all images of omega"),
    Field("second_hz", "number", "Hz", "the next line, if it has more than a third of the energy; missing without"),
)
MARGINS = (
    Field(
        "cut",
        "string",
        "",
        "signal at which the loop is broken; L is the loop from it back to it, over a frame: that of the lifted signal if it "
        "is made several times in one, with the same factor on all of its samples",
    ),
    Field(
        "margin",
        "string",
        "",
        "gain_up, gain_down: factors of the signal at which stability ends; phase; delay: whole frames that last less leave "
        "the loop stable; disk, disk_gain, disk_phase: gain and phase together; sensitivity: the largest |1/(1 + L)|; "
        "complementary: the largest |L/(1 + L)|; of a lifted signal singular values, and no delay",
        values={
            "gain_up": "the loop stays stable if the signal is multiplied by up to this factor; 1e6 means: by any",
            "gain_down": "the loop stays stable if the signal is multiplied by down to this factor; 0 means: by any",
            "phase": "phase (deg) that the signal may lose or gain; 180 means: any",
            "delay": "further delay (s) of the signal up to which the loop stays stable; 1e6 frames mean: any",
            "disk": "the largest a for which every factor (1 + a d/2)/(1 - a d/2), |d| < 1, leaves the loop stable",
            "disk_gain": "how far the gain alone may move within the disk, up or down by this factor; 1e6 means: by any",
            "disk_phase": "how far the phase (deg) alone may move within the disk",
            "sensitivity": "Ms, the largest factor by which a disturbance is amplified; usual designs have less than 2",
            "complementary": "Mt, the largest factor by which a command is amplified; usual designs have less than 1.5",
        },
        advice="Where the column limited is 0 there is no limit, and the value is the end of what was looked at.",
    ),
    Field(
        "value",
        "number",
        "",
        "the margin, in its unit; without a limit 0 for gain_down, 1e6 for other gains, 180 deg, 1e6 frames; missing in doubt",
    ),
    Field("unit", "string", "", "unit of the value"),
    Field("omega", "number", "rad/s", "its frequency, up to half the rate of the frame"),
    Field("bound", "number", "1", "bound on the relative error of the value, to first order"),
    Field("certified", "boolean", "", "nothing was missed, and the bound is at most 1e-6"),
    _doubt("why it is not certified", OF_MARGINS, "empty if it is"),
    Field("limited", "boolean", "", "there is a limit; otherwise the value is the end of what was looked at"),
)

# Of devices from logs.
IDENTIFY = (
    Field("time_s", "number", "s", "time of the sample, equally spaced"),
    Field("force", "number", "N", "force of the log, held to the next sample"),
    Field("position", "number", "m", "position of the log", optional=True),
    Field("velocity", "number", "m/s", "velocity of the log, in place of the position", optional=True),
    Field("acceleration", "number", "m/s^2", "acceleration of the log, in place of the position", optional=True),
    Field("fitted", "number", "m", "the same of the fitted model; missing in the first rows, which are not fitted"),
    Field("residual", "number", "m", "what was measured minus fitted"),
    Field("weight", "number", "1", "1 if the row is fitted; 0 in the first rows, and for an outlier"),
)
IDENTIFY_RESPONSE = (
    Field("frequency_hz", "number", "Hz", "frequency"),
    Field("measured_abs", "number", "m/N", "modulus of the measured admittance"),
    Field("measured_deg", "number", "deg", "its phase"),
    Field("fitted_abs", "number", "m/N", "modulus of the admittance of the fitted model, sampled"),
    Field("fitted_deg", "number", "deg", "its phase"),
    Field("residual_abs", "number", "1", "modulus of measured over fitted minus 1"),
    Field("coherence", "number", "1", "coherence of the measurement; 1 where the file has none"),
)

# Of designs, behind the numbers that are varied and the wishes.
DESIGN = (
    Field("certified", "boolean", "", "all values of the row are certified"),
    Field("holds", "boolean", "", "every bound holds with the values looked at between the ends of every range as well"),
    Field("z_width_box", "number", "N/m", "the stiffest wall, up to z_width, that is stable with every hand of the box"),
    Field("box_settled", "boolean", "", "z_width_box is proved, but for a thousandth of it, and not only searched"),
)

COLUMNS: Mapping[str, tuple[Field, ...]] = MappingProxyType(
    {
        "zwidth": INTERVALS,
        "stability-region": INTERVALS,
        "compare": COMPARE,
        "zwidth-hands": INTERVALS_FOR_HANDS,
        "stability-region-hands": INTERVALS_FOR_HANDS,
        "passivity-along": INTERVALS_FOR_HANDS,
        "bode": BODE,
        "compare-bode": BODE,
        "bode-ports": BODE_PORTS,
        "simulate": SIMULATE,
        "simulate-response": SIMULATE_RESPONSE,
        "passivity": PASSIVITY,
        "passivity-filters": PASSIVITY_FILTERS,
        "why": WHY,
        "margins": MARGINS,
        "identify": IDENTIFY,
        "identify-response": IDENTIFY_RESPONSE,
    }
)
"""The columns of each table behind those of its axes; those of a design follow from its spec."""
