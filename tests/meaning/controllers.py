"""The eight controllers, row by row of docs/controllers.md, in exact time."""

import math
from fractions import Fraction
from typing import ClassVar

from meaning import filters
from meaning.machine import Instant, Schedule, exact, form, scaled

PRESETS = {  # of `wavesweep keys device.preset`: mass (kg) and damping (N s/m), where they are known
    "paper": (0.1, 1.5),
    "touch": (0.045, 0.5),
    "omni": (0.045, 0.5),
    "desktop": (0.045, None),
    "falcon": (0.2, 2.0),
    "omega": (None, None),
    "sigma": (None, None),
    "lambda": (None, None),
}
FILTERS = {"lp1": (1, 10.0, "low"), "hp": (1, 10.0, "high"), "lp2": (2, 20.0, "low")}
SHOWN = {"x": "x", "v": "v", "v_hat": "v_hat", "f_m": "f_m now", "F_s": "held F"}
WAVES = {"u_m": "u_m", "v_m": "v_m"}


class Keys:
    """The tables of a spec; remembers which keys were asked for."""

    asked: ClassVar[set[str]] = set()

    def __init__(self, tables: dict):
        self.tables = tables

    def __call__(self, path: str, default=None):
        Keys.asked.add(path)
        table = self.tables
        for name in path.split("."):
            if not isinstance(table, dict) or name not in table:
                return default
            table = table[name]
        return table


def read(tables: dict) -> Schedule:
    """The schedule of a spec that has a [controller]."""
    return Controller(Keys(tables)).schedule()


class Controller:
    """One spec's numbers, and the equations that its kind makes of them."""

    def __init__(self, key: Keys):
        self.key = key
        self.kind = key("controller.kind")
        fast = exact(key("rates.fast_hz", 1000.0))
        self.T = 1 / fast
        ratio = key("rates.ratio")
        slow = key("rates.slow_hz")
        if slow is not None:
            self.ratio = fast / exact(slow)
        else:
            self.ratio = Fraction(20 if ratio is None else ratio)
        if self.kind == "dc":
            self.ratio = Fraction(1)
        self.Ts = float(self.ratio * self.T)
        self.read_device()
        self.K = float(key("environment.K_VE", 500.0))
        self.B = float(key("environment.B_VE", 1.0))
        self.integration = key("environment.integration", "implicit")
        self.delay = 0 if self.kind == "dc" else key("environment.delay", 0)
        self.b = float(key("controller.b", 25.0))
        self.Kp = float(key("controller.Kp", 0.0))
        self.K_VC = float(key("controller.K_VC", 1000.0))
        self.B_VC = float(key("controller.B_VC", 5.0))
        self.K_LM = float(key("local_model.K_LM", 500.0))
        self.B_LM = float(key("local_model.B_LM", 0.0))
        self.local_integration = key("local_model.integration", "implicit")
        self.local_delay = key("local_model.delay", 1)

    def read_device(self):
        key = self.key
        mass, damping = PRESETS[key("device.preset", "paper")]
        self.mass = float(key("device.mass", mass)) + float(key("operator.mass", 0.0))
        self.damping = float(key("device.damping", damping)) + float(key("operator.damping", 0.0))
        self.stiffness = float(key("operator.stiffness", 0.0))
        self.velocity = key("device.velocity", "exact")
        dead = exact(key("device.dead_time", 0.0)) + key("device.delay", 0) * self.T
        self.late_ticks = math.floor(dead / self.T)
        self.late_rest = dead - self.late_ticks * self.T

    # When things happen

    def schedule(self) -> Schedule:
        """All instants of one period.

        Slow event j happens at j T_s. If a fast tick is there, it reads what this tick has; else
        what the last tick before it had. Its result is in place from the first tick on that is not
        before j T_s + D T, or for "frame" not before (j + 1) T_s.
        """
        ticks = self.ratio.numerator
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
            shown = math.ceil(place + self.ratio) if self.delay == "frame" else math.ceil(place) + self.delay
            arrives.setdefault(shown % ticks, []).append(event)
        kinds: dict[object, Instant] = {}
        times: list[tuple[Fraction, object]] = []
        rank: list[tuple[Fraction, int, object]] = []
        for tick in range(ticks):
            come = tuple(event for event in arrives.get(tick, []) if not self.at_once(event, aligned, tick))
            kind = ("tick", come, aligned.get(tick))
            if kind not in kinds:
                kinds[kind] = self.tick(come, aligned.get(tick))
            rank.append((tick * self.T, 1, kind))
            if self.late_rest:
                kinds["motor"] = Instant({}, {"@f": {f"@m{self.late_ticks}": 1.0}})
                rank.append((tick * self.T + self.late_rest, 2, "motor"))
        for place, event in between:
            kinds["slow", event] = self.slow_between(event)
            rank.append((place * self.T, 3, ("slow", event)))
        rank.sort(key=lambda row: row[:2])
        ticks_at = {}
        for at, (time, order, kind) in enumerate(rank):
            if order == 1:
                ticks_at[at] = len(ticks_at)
            times.append((time, kind))
        motion = {
            "@x": {"@v": 1.0},
            "@v": {
                "@x": -self.stiffness / self.mass,
                "@v": -self.damping / self.mass,
                "@f": -1 / self.mass,
                "@hand": 1 / self.mass,
            },
        }
        shown = dict(SHOWN)
        if self.kind.startswith("pmw"):
            shown |= WAVES
        return Schedule(ticks * self.T, kinds, times, ticks_at, motion, shown)

    def at_once(self, event, aligned, tick) -> bool:
        """Whether the result is in place in the tick that it is computed from."""
        return self.delay == 0 and aligned.get(tick) == event

    # What happens in a tick

    def tick(self, come, event) -> Instant:
        """The fast loop; results `come` are in place before it, slow event `event` is in it."""
        equations = {
            "x": {"@x": 1.0},
            "v": {"@v": 1.0},
            "v_hat": {"@v": 1.0},
        }
        writes = {"@hand": {"!hand": 1.0}, "@read x": {"x": 1.0}, "@read v": {"v_hat": 1.0}}
        if self.velocity == "difference":
            rate = 1 / float(self.T)
            equations["v_hat"] = {"@x": rate, "@x before": -rate}
            writes["@x before"] = {"x": 1.0}
        for name in self.results():
            if event is not None and self.delay == 0:
                equations[f"held {name}"] = {f"new {name}": 1.0}
            elif come:
                equations[f"held {name}"] = {f"@{come[-1]} {name}": 1.0}
            else:
                equations[f"held {name}"] = {f"@held {name}": 1.0}
            writes[f"@held {name}"] = {f"held {name}": 1.0}
        getattr(self, "fast_" + self.kind.replace("-", "_"))(equations, writes)
        if event is not None:
            self.slow(equations, writes, event, "x", "v_hat", self.sampled(equations, "u_s"))
        self.motors(equations, writes)
        return Instant(equations, writes)

    def slow_between(self, event) -> Instant:
        """A slow event between ticks: it reads what the last tick had."""
        equations: dict[str, dict] = {}
        writes: dict[str, dict] = {}
        self.slow(equations, writes, event, "@read x", "@read v", "@read u_s")
        return Instant(equations, writes)

    def motors(self, equations, writes):
        """The force of tick k acts from k T on, plus delay and dead time; `f_m now` is what acts as a tick begins."""
        if self.late_ticks == 0 and not self.late_rest:
            equations["f_m now"] = {"f_m": 1.0}
            writes["@f"] = {"f_m": 1.0}
            return
        equations["f_m now"] = {"@f": 1.0} if self.late_rest else {f"@m{self.late_ticks - 1}": 1.0}
        writes["@f"] = {"f_m now": 1.0}
        writes["@m0"] = {"f_m": 1.0}
        for number in range(self.late_ticks):
            writes[f"@m{number + 1}"] = {f"@m{number}": 1.0}

    def results(self) -> list[str]:
        """What a slow event gives to the fast loop."""
        if self.kind == "dc":
            return ["F"]
        if self.kind == "dc-slow":
            return ["F"]
        if self.kind == "dc-lm":
            return ["F", "x_ref", "v_ref"]
        if self.kind in {"dc-vc", "dc-vc-lm"}:
            return ["F", "x_s", "v_s"]
        return ["F", "w", "x_s"]

    def sampled(self, equations, name):
        return name if name in equations else None

    # What a slow event computes

    def slow(self, equations, writes, event, x, v, wave):
        new = {}
        if self.kind in {"dc", "dc-slow", "dc-lm"}:
            equations["slow F"] = {x: self.K, v: self.B}
            new = {"F": "slow F", "x_ref": x, "v_ref": v}
        else:
            spring = self.avatar(equations, writes, "slow", self.integration, self.Ts)
            equations["slow F"] = form(scaled(self.K, spring), (self.B, "slow speed"))
            if self.kind in {"dc-vc", "dc-vc-lm"}:
                # B_VC (v - x_s') + K_VC (x - x~) = F
                equations["slow speed"] = form(
                    (1.0, v),
                    (self.K_VC / self.B_VC, x),
                    scaled(-self.K_VC / self.B_VC, spring),
                    (-1 / self.B_VC, "slow F"),
                )
                new = {"F": "slow F", "x_s": "slow place", "v_s": "slow speed"}
            else:
                equations["slow speed"] = {wave: math.sqrt(2 * self.b) / self.b, "slow F": -1 / self.b}
                equations["slow wave"] = {wave: 1.0, "slow F": -math.sqrt(2 / self.b)}
                new = {"F": "slow F", "w": "slow wave", "x_s": "slow place"}
        for name in self.results():
            equations[f"new {name}"] = {new[name]: 1.0}
            writes[f"@{event} {name}"] = {f"new {name}": 1.0}

    def avatar(self, equations, writes, name, integration, step) -> dict:
        """The position moves with `name speed`; the place that the spring reads."""
        before = f"@{name} place"
        moved = {before: 1.0, f"{name} speed": step}
        if integration == "trapezoidal":
            moved = {before: 1.0, f"{name} speed": step / 2, f"@{name} speed": step / 2}
            writes[f"@{name} speed"] = {f"{name} speed": 1.0}
        equations[f"{name} place"] = moved
        writes[before] = {f"{name} place": 1.0}
        return {before: 1.0} if integration == "explicit" else {f"{name} place": 1.0}

    # What the fast loop computes

    def fast_dc(self, equations, writes):
        del writes
        equations["f_m"] = {"held F": 1.0}

    fast_dc_slow = fast_dc

    def fast_dc_lm(self, equations, writes):
        del writes
        equations["f_m"] = {
            "held F": 1.0,
            "x": self.K_LM,
            "held x_ref": -self.K_LM,
            "v_hat": self.B_LM,
            "held v_ref": -self.B_LM,
        }

    def fast_dc_vc(self, equations, writes):
        del writes
        equations["f_m"] = {
            "x": self.K_VC,
            "held x_s": -self.K_VC,
            "v_hat": self.B_VC,
            "held v_s": -self.B_VC,
        }

    def fast_dc_vc_lm(self, equations, writes):
        spring = self.avatar(equations, writes, "local", self.local_integration, float(self.T))
        equations["local F"] = form(
            (1.0, "held F"),
            scaled(self.K_LM, spring),
            (-self.K_LM, "held x_s"),
            (self.B_LM, "local speed"),
            (-self.B_LM, "held v_s"),
        )
        equations["local speed"] = form(
            (1.0, "v_hat"),
            (self.K_VC / self.B_VC, "x"),
            scaled(-self.K_VC / self.B_VC, spring),
            (-1 / self.B_VC, "local F"),
        )
        equations["f_m"] = {"local F": 1.0}

    def waves(self, equations, returned):
        root = math.sqrt(2 * self.b)
        equations["v_m"] = form(returned, (self.Kp, "held x_s"), (-self.Kp, "x"))
        equations["u_m"] = {"v_hat": root, "v_m": -1.0}
        equations["f_m"] = {"v_hat": self.b, "v_m": -root}

    def fast_pmw(self, equations, writes):
        self.waves(equations, {"held w": 1.0})
        self.filter(equations, writes, "lp1", "u_m", "u_s")
        writes["@read u_s"] = {"u_s": 1.0}

    def fast_pmw_mean(self, equations, writes):
        self.waves(equations, {"held w": 1.0})
        count = round(self.ratio)
        mean = {"u_m": 1 / count}
        for number in range(count - 1):
            mean[f"@u{number}"] = 1 / count
            writes[f"@u{number}"] = {f"@u{number - 1}": 1.0} if number else {"u_m": 1.0}
        equations["u_s"] = mean
        writes["@read u_s"] = {"u_s": 1.0}

    def fast_pmw_lm(self, equations, writes):
        local = {"@v_2": 1.0} if self.local_delay else {"lp2 out": 1.0}
        self.waves(equations, form((1.0, "held w"), local))
        self.filter(equations, writes, "lp1", "u_m", "u_s")
        writes["@read u_s"] = {"u_s": 1.0}
        self.filter(equations, writes, "hp", "u_m", "u_l")
        spring = self.avatar(equations, writes, "local", self.local_integration, float(self.T))
        equations["local F"] = form(scaled(self.K_LM, spring), (self.B_LM, "local speed"))
        equations["local speed"] = {"u_l": math.sqrt(2 * self.b) / self.b, "local F": -1 / self.b}
        equations["v_l"] = {"u_l": 1.0, "local F": -math.sqrt(2 / self.b)}
        self.filter(equations, writes, "lp2", "v_l", "lp2 out")
        writes["@v_2"] = {"lp2 out": 1.0}

    def filter(self, equations, writes, name, source, out):
        """Sections in series; order 0 is none."""
        order, cutoff, side = FILTERS[name]
        rate = float(1 / self.T)
        edges = {}
        for edge in ("passband_hz", "stopband_hz", "passband_db", "stopband_db"):
            edges[edge] = self.key(f"filters.{name}.{edge}")
        order = self.key(f"filters.{name}.order", order)
        cutoff = float(self.key(f"filters.{name}.cutoff_hz", cutoff))
        if None not in edges.values():
            order, cutoff = filters.order_and_cutoff(edges, rate, side)
        sections = filters.butterworth(order, cutoff, rate, side) if order else []
        add_sections(equations, writes, name, sections, source, out)


def add_sections(equations, writes, name, sections, source, out):
    """Models of one input and one output in series, from variable `source` to `out`."""
    for number, model in enumerate(sections):
        into = source if number == 0 else f"{name} section {number - 1}"
        add_model(equations, writes, f"{name} {number}", model, {into: 1.0}, f"{name} section {number}")
    last = f"{name} section {len(sections) - 1}" if sections else source
    equations[out] = {last: 1.0}


def add_model(equations, writes, name, model, source, out):
    """x+ = A x + B u, out = C x + D u with u = `source`."""
    A, B, C, D = model
    states = [f"@{name} state {number}" for number in range(len(A))]
    equations[out] = form(scaled(D, source), *((float(C[at]), state) for at, state in enumerate(states)))
    for at, state in enumerate(states):
        inside = [(float(A[at, other]), states[other]) for other in range(len(states))]
        writes[state] = form(scaled(float(B[at]), source), *inside)
