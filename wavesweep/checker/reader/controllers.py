"""The eight controllers, row by row of docs/controllers.md, in exact time.

The memory of a loop, by the names in proof files; each is written at the end of an instant with what stands behind it:

    @x, @v                     position and velocity of the device, which move between instants with f = @f held
    @f                         the motors' force that acts; behind a delay @m0, @m1 .. those of the last ticks, the newest first
    @x before                  the position of the last tick, if velocity is a difference
    @held NAME                 a slow result in place: F; of dc-lm also x_ref, v_ref; of dc-vc(-lm) F, x_s, v_s; of pmw F, w, x_s
    @J NAME                    the result of slow event J of a period, J = 0 where rates divide, until it is in place
    @read x, @read v, @read u_s    what the last tick had, for a slow event between ticks
    @slow place, @local place  the avatars of environment and local model, and @slow speed, @local speed if trapezoidal
    @FILTER K state I          state I of section K of lp1, hp or lp2 (filters.py)
    @v_2                       the local model's wave of the last tick;   @uK of pmw-mean u_m K + 1 ticks ago
"""

import math
from fractions import Fraction
from typing import Any

from . import filters
from .expressions import equations_of
from .loops import (
    Instant,
    Keys,
    Schedule,
    Unreadable,
    bounded,
    form,
    scaled,
    shifted,
    ticks_and_rest,
    warped,
)
from .names import EDGES, RULES, SYMBOLS

PRESETS = {  # of `wavesweep keys device.preset`: mass (kg) and damping (N s/m), where they are known
    "paper": ("0.1", "1.5"),
    "touch": ("0.045", "0.5"),
    "omni": ("0.045", "0.5"),
    "desktop": ("0.045", None),
    "falcon": ("0.2", "2"),
    "omega": (None, None),
    "sigma": (None, None),
    "lambda": (None, None),
}
DEFAULTS = {
    "K_VE": 500,
    "B_VE": 1,
    "b": 25,
    "Kp": 0,
    "K_VC": 1000,
    "B_VC": 5,
    "K_LM": 500,
    "B_LM": 0,
}
FILTERS = {"lp1": (1, "10", "low"), "hp": (1, "10", "high"), "lp2": (2, "20", "low")}
ROUNDING = Fraction(10) ** -12
FILTERS_OF = {"pmw": ("lp1",), "pmw-lm": tuple(FILTERS)}
CUTS = {  # signals at which a loop can be cut, by its family
    ("pmw", "encoder.force"): "f_m",
    ("dc", "wall.y"): "slow F",
}
SHOWN = {"x": "x", "v": "v", "v_hat": "v_hat", "f_m": "f_m now", "F_s": "held F"}
WAVES = {"u_m": "u_m", "v_m": "v_m"}
FILTERED = {"lp1": ("u_m", "u_s"), "hp": ("u_m", "u_l"), "lp2": ("v_l", "lp2 out")}
RESULTS = {  # what a slow event gives to the fast loop
    "dc": "F",
    "dc-slow": "F",
    "dc-lm": "F x_ref v_ref",
    "dc-vc": "F x_s v_s",
    "dc-vc-lm": "F x_s v_s",
    "pmw": "F w x_s",
    "pmw-mean": "F w x_s",
    "pmw-lm": "F w x_s",
}
# Laws, with the names above: a dot is a space, and memory.NAME is @NAME.
DEVICE = (
    "memory.x = memory.v;"
    "memory.v = (memory.hand - stiffness*memory.x - damping*memory.v - memory.f)/mass"
)
SAMPLED = "x = memory.x; v = memory.v; memory.read.x = x; memory.read.v = v_hat"
VELOCITY = {
    "exact": "v_hat = memory.v",
    "difference": "v_hat = (memory.x - memory.x.before)/T; memory.x.before = x",
}
MOVED = "; memory.{place}.place = {place}.place"
AVATAR = {
    "implicit": "{place}.place = memory.{place}.place + {step}*{place}.speed" + MOVED,
    "trapezoidal": "{place}.place = memory.{place}.place + {step}/2*({place}.speed + memory.{place}.speed);"
    "memory.{place}.speed = {place}.speed" + MOVED,
}
AVATAR["explicit"] = AVATAR["implicit"]
SPRING = {  # the place that it reads
    "explicit": "memory.{place}.place",
    "implicit": "{place}.place",
    "trapezoidal": "{place}.place",
}
WALL = "slow.F = K_VE*{x} + B_VE*{v}; new.F = slow.F"
AT_AVATAR = "slow.F = K_VE*{spring} + B_VE*slow.speed; new.F = slow.F; new.x_s = slow.place;"
# B_VC (v - x_s') + K_VC (x - x~) = F
COUPLED = (
    f"{AT_AVATAR} slow.speed = {{v}} + K_VC/B_VC*({{x}} - {{spring}}) - slow.F/B_VC;"
    "new.v_s = slow.speed"
)
REFLECTED = (
    f"{AT_AVATAR} slow.speed = sqrt(2*b)/b*{{wave}} - slow.F/b;"
    "new.w = {wave} - sqrt(2*b)/b*slow.F"
)
SLOW = {"dc": WALL, "dc-slow": WALL, "dc-lm": f"{WALL}; new.x_ref = {{x}}; new.v_ref = {{v}}"}
SLOW |= dict.fromkeys(("dc-vc", "dc-vc-lm"), COUPLED)
SLOW |= dict.fromkeys(("pmw", "pmw-mean", "pmw-lm"), REFLECTED)
WAVE = (
    "u_m = sqrt(2*b)*v_hat - v_m; f_m = b*v_hat - sqrt(2*b)*v_m; memory.read.u_s = u_s;"
    "v_m = held.w + Kp*(held.x_s - x)"
)
FAST = {
    "dc": "f_m = held.F",
    "dc-slow": "f_m = held.F",
    "dc-lm": "f_m = held.F + K_LM*(x - held.x_ref) + B_LM*(v_hat - held.v_ref)",
    "dc-vc": "f_m = K_VC*(x - held.x_s) + B_VC*(v_hat - held.v_s)",
    "dc-vc-lm": "f_m = local.F;"
    "local.F = held.F + K_LM*({spring} - held.x_s) + B_LM*(local.speed - held.v_s);"
    "local.speed = v_hat + K_VC/B_VC*(x - {spring}) - local.F/B_VC",
    "pmw": WAVE,
    "pmw-mean": WAVE,
    "pmw-lm": WAVE + " + {local}; memory.v_2 = lp2.out; v_l = u_l - sqrt(2*b)/b*local.F;"
    "local.F = K_LM*{spring} + B_LM*local.speed; local.speed = sqrt(2*b)/b*u_l - local.F/b",
}


class Controller:
    """One spec's numbers, and the equations that its kind makes of them."""

    def __init__(self, tables: dict, arithmetic, cut: str = ""):
        self.arithmetic = arithmetic
        self.key = key = Keys(tables)
        for path, rule in RULES.items():
            value = Keys(tables)(path)
            if value is not None and (path, value) != ("environment.delay", "frame"):
                rule.refuse(path, value, arithmetic)
        self.kind = key("controller.kind")
        if self.kind is None:
            raise Unreadable("controller.kind is missing")
        self.cut = CUTS.get((self.kind.partition("-")[0], cut), "")
        exact = self.arithmetic.exact
        fast = exact(key("rates.fast_hz", 1000))
        self.T = 1 / fast
        self.ratio = self.read_ratio(fast)
        self.delay = key("environment.delay", 0)
        if self.delay != "frame":
            self.delay = self.arithmetic.whole(self.delay)
            if self.delay > math.ceil(self.ratio):
                raise Unreadable(
                    f"environment.delay = {self.delay} is beyond the longest frame, {math.ceil(self.ratio)} ticks"
                )
        if self.kind == "dc":
            self.ratio = Fraction(1)
            self.delay = 0
        self.Ts = self.ratio * self.T
        self.read_device()
        self.integration = key("environment.integration", "implicit")
        for symbol, path in SYMBOLS.items():
            setattr(self, symbol, self.number(path, DEFAULTS[symbol]))
        self.local_integration = key("local_model.integration", "implicit")
        self.local_delay = self.arithmetic.whole(key("local_model.delay", 1))
        self.filters = {name: self.read_filter(name) for name in FILTERS}

    def read_ratio(self, fast: Fraction) -> Fraction:
        """Ticks in a frame: a whole number, or what comes round within 10,000 ticks."""
        ratio = self.key("rates.ratio")
        slow = self.key("rates.slow_hz")
        if ratio is not None and slow is not None:
            raise Unreadable("rates.ratio and rates.slow_hz are one number, and both stand there")
        if slow is None:
            frame = 20 if ratio is None else ratio
            self.arithmetic.whole(frame)
            return self.arithmetic.exact(frame)
        quotient = fast / self.arithmetic.exact(slow)
        if not 1 <= quotient <= 1000 or (
            quotient.denominator > 1 and (quotient < 2 or quotient.numerator > 10_000)
        ):
            raise Unreadable(
                f"rates.slow_hz makes frames of {float(quotient):g} ticks: expected 1 to 1000 of them, in step within 10,000"
            )
        return quotient

    def number(self, path, default):
        value = self.key(path, default)
        if value is None:
            raise Unreadable(f"{path} is missing")
        return self.arithmetic.number(value)

    def read_device(self):
        key = self.key
        mass, damping = PRESETS[key("device.preset", "paper")]
        self.mass = self.number("device.mass", mass) + self.number("operator.mass", 0)
        self.damping = self.number("device.damping", damping) + self.number("operator.damping", 0)
        self.stiffness = self.number("operator.stiffness", 0)
        self.velocity = key("device.velocity", "exact")
        exact = self.arithmetic.exact
        time = self.arithmetic.time(key("device.dead_time", 0))
        dead = time + exact(key("device.delay", 0)) * self.T
        path = "device.delay with device.dead_time"
        self.late_ticks, self.late_rest = ticks_and_rest(dead, self.T, path, self.arithmetic)

    # When things happen

    def schedule(self, lost: bool = False) -> Schedule:
        """All instants of one period; lost: no result comes in it, and the last one that came is held.

        Slow event j happens at j T_s. If a fast tick is there, it reads what this tick has; else
        what the last tick before it had. Its result is in place from the first tick on that is not
        before j T_s + D T, or for "frame" not before (j + 1) T_s.
        """
        ticks = bounded(self.ratio.numerator, "a period in ticks")
        frames = self.ratio.denominator
        aligned = {}
        between = []
        arrives: dict[int, list[int]] = {}
        for event in range(frames):
            place = event * self.ratio
            if place.denominator == 1:
                aligned[int(place)] = event
            else:
                between.append((place, event))
            arrives.setdefault(self.first_tick_with_result(place) % ticks, []).append(event)
        kinds: dict[object, Instant] = {}
        # (time, kind of instant), and between them what comes first at a time: 1 tick, 2 motors, 3 slow event between ticks.
        rank: list[tuple[Any, int, object]] = []
        for tick in range(ticks):
            events = arrives.get(tick, [])
            # A result of this tick itself is not read from memory: `tick` has an equation for it.
            come = tuple(event for event in events if not self.at_once(event, aligned, tick))
            kind = ("tick", () if lost else come, aligned.get(tick))
            if kind not in kinds:
                kinds[kind] = self.tick(kind[1], aligned.get(tick), lost)
            rank.append((tick * self.T, 1, kind))
            if self.late_rest:
                kinds["motor"] = Instant({}, {"@f": {f"@m{self.late_ticks}": 1}})
                rank.append((tick * self.T + self.late_rest, 2, "motor"))
        for place, event in between:
            kinds["slow", event] = self.slow_between(event)
            rank.append((place * self.T, 3, ("slow", event)))
        shown = SHOWN | (WAVES if self.kind.startswith("pmw") else {})
        return Schedule.of(ticks * self.T, kinds, rank, self.motion(), shown, self.arithmetic.least)

    def first_tick_with_result(self, place: Fraction) -> int:
        """The first tick in which the result of an event at a place, in ticks, is in place."""
        if self.delay == "frame":
            return math.ceil(place + self.ratio)
        return math.ceil(place) + self.delay

    def motion(self) -> Instant:
        """The device: m v' = -d v - k x - f + f_h."""
        return Instant(*self.laws(DEVICE))

    def at_once(self, event, aligned, tick) -> bool:
        """Whether the result is in place in the tick that it is computed from."""
        return self.delay == 0 and aligned.get(tick) == event

    # What happens in a tick

    def tick(self, come, event, lost=False) -> Instant:
        """The fast loop; results `come` are in place before it, slow event `event` is in it; its result may be lost."""
        equations, writes = self.laws(f"{SAMPLED}; {VELOCITY[self.velocity]}")
        writes["@hand"] = {"!hand": 1}
        for name in RESULTS[self.kind].split():
            if event is not None and self.delay == 0 and not lost:
                equations[f"held {name}"] = {f"new {name}": 1}
            elif come:
                equations[f"held {name}"] = {f"@{come[-1]} {name}": 1}
            else:
                equations[f"held {name}"] = {f"@held {name}": 1}
            writes[f"@held {name}"] = {f"held {name}": 1}
        self.fast(equations, writes)
        if event is not None:
            self.slow(equations, writes, event, "x", "v_hat", "u_s")
        self.motors(equations, writes)
        return self.with_cut(equations, writes)

    def slow_between(self, event) -> Instant:
        """A slow event between ticks: it reads what the last tick had."""
        equations: dict[str, dict] = {}
        writes: dict[str, dict] = {}
        self.slow(equations, writes, event, "memory.read.x", "memory.read.v", "memory.read.u_s")
        return self.with_cut(equations, writes)

    def with_cut(self, equations, writes) -> Instant:
        """What happens at once, with an input added to the signal at the cut where it is read."""
        if self.cut not in equations:
            return Instant(equations, writes)

        def behind(rows):
            return {
                name: {
                    ("cut" if name_of_term == self.cut else name_of_term): c
                    for name_of_term, c in row.items()
                }
                for name, row in rows.items()
            }

        equations = behind(equations) | {"cut": {self.cut: 1, "!cut": 1}}
        return Instant(equations, behind(writes))

    def motors(self, equations, writes):
        """The force of tick k acts from k T on, plus delay and dead time; `f_m now` is what acts as a tick begins."""
        if self.late_ticks == 0 and not self.late_rest:
            equations["f_m now"] = {"f_m": 1}
            writes["@f"] = {"f_m": 1}
            return
        equations["f_m now"] = {"@f": 1} if self.late_rest else {f"@m{self.late_ticks - 1}": 1}
        writes["@f"] = {"f_m now": 1}
        writes |= shifted("@m", self.late_ticks, {"f_m": 1})

    def laws(self, law: str, **names) -> tuple[dict, dict]:
        """Equations and what they write, by the names of this file with dots for spaces; names: of what braces stand for."""
        return equations_of(law.format(**names), called, self.form_of, self.arithmetic)

    def form_of(self, name: str) -> dict:
        return {"": vars(self)[name]} if name in vars(self) else {called(name): 1}

    # What a slow event computes

    def slow(self, equations, writes, event, x, v, wave):
        """Add the law of the slow environment to what happens at an event; x, v, wave: names of what it reads."""
        law = SLOW[self.kind]
        if "slow.speed" in law:
            law = f"{law}; {AVATAR[self.integration]}"
        spring = SPRING[self.integration].format(place="slow")
        equations_of_law, writes_of_law = self.laws(
            law, x=x, v=v, wave=wave, place="slow", step="Ts", spring=spring
        )
        equations |= equations_of_law
        writes |= writes_of_law
        for name in RESULTS[self.kind].split():
            writes[f"@{event} {name}"] = {f"new {name}": 1}

    # What the fast loop computes

    def fast(self, equations, writes):
        law = FAST[self.kind]
        if "local.speed" in law:
            law = f"{law}; {AVATAR[self.local_integration]}"
        local = "memory.v_2" if self.local_delay else "lp2.out"
        spring = SPRING[self.local_integration].format(place="local")
        equations_of_law, writes_of_law = self.laws(
            law, local=local, place="local", step="T", spring=spring
        )
        equations |= equations_of_law
        writes |= writes_of_law
        for name in FILTERS_OF.get(self.kind, ()):
            add_sections(equations, writes, name, self.filters[name], *FILTERED[name])
        if self.kind == "pmw-mean":
            count = round(self.ratio)
            share = Fraction(1, count)
            means = ["u_m", *(f"@u{number}" for number in range(count - 1))]
            equations["u_s"] = dict.fromkeys(means, share)
            writes |= shifted("@u", count - 2, {"u_m": 1}) if count > 1 else {}

    def read_filter(self, name: str) -> list[tuple]:
        """Sections in series; order 0 is none, and a filter that the controller has not sets no limit to its cutoff."""
        order, cutoff, side = FILTERS[name]
        path = f"filters.{name}"
        edges = {edge: self.key(f"{path}.{edge}") for edge in EDGES}
        edges_written = [edge for edge in EDGES if edges[edge] is not None]
        if edges_written and len(edges_written) < len(EDGES):
            raise Unreadable(f"{path} has {edges_written[0]} without all of {', '.join(EDGES)}")
        own_order, own_cutoff = self.key(f"{path}.order"), self.key(f"{path}.cutoff_hz")
        if edges_written:
            order, warped = filters.order_and_cutoff(edges, self.warped, side, self.arithmetic)
            same = own_cutoff is None or self.alike(self.warped(own_cutoff), warped)
            if own_order not in (None, order) or not same:
                raise Unreadable(
                    f"{path} has band edges, and another order or cutoff_hz beside them"
                )
        else:
            order = self.arithmetic.whole(order if own_order is None else own_order)
            if not order or name not in FILTERS_OF.get(self.kind, ()):
                return []
            warped = self.warped(cutoff if own_cutoff is None else own_cutoff)
        return filters.butterworth(order, warped, side, self.arithmetic)

    def alike(self, value, reference) -> bool:
        """Whether two numbers differ by the rounding of doubles alone."""
        low, high = self.arithmetic.ends(value / reference - 1)
        return low > -ROUNDING and high < ROUNDING

    def warped(self, hertz):
        path = "a frequency of a filter"
        return warped(self.arithmetic.number(hertz), self.T, path, self.arithmetic)


def called(name: str) -> str:
    """What a name of a law stands for."""
    return name.replace("memory.", "@").replace(".", " ")


def add_sections(equations, writes, name, sections, source, out):
    """Models of one input and one output in series, from variable `source` to `out`."""
    for number, model in enumerate(sections):
        into = source if number == 0 else f"{name} section {number - 1}"
        add_model(
            equations, writes, f"{name} {number}", model, {into: 1}, f"{name} section {number}"
        )
    last = f"{name} section {len(sections) - 1}" if sections else source
    equations[out] = {last: 1}


def add_model(equations, writes, name, model, source, out):
    """x+ = A x + B u, out = C x + D u with u = `source`."""
    A, B, C, D = model
    states = [f"@{name} state {number}" for number in range(len(A))]
    equations[out] = form(scaled(D, source), dict(zip(states, C, strict=True)))
    for state, row, fed in zip(states, A, B, strict=True):
        writes[state] = form(scaled(fed, source), dict(zip(states, row, strict=True)))
