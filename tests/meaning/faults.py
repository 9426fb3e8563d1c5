"""Whatever a spec and the options of a command are, the command ends in an answer or in a sentence: random specs, some with two
more keys, through all commands, each for a short time."""

import io
import re
import signal
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout, suppress
from importlib import import_module
from pathlib import Path

from meaning.pairs import WRONG, base, pair, taken
from meaning.required import Found
from meaning.specs import Draw, toml

from wavesweep.program.cli import main

SECONDS = 0.5  # of processor time for a command; one that is not done by then is interrupted
FAULT = re.compile(r"fault of wavesweep|Warning:")
ENDS = (0, 1, 2, 130)  # codes of commands
ODD = ("", "nan", "-1", "0", "1e400", "x", "K,K", "..", "x.y", "K_VE,", "inf")  # what is hardly ever right
HEAVY = ("matplotlib.figure", "matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg", "pandas", "pyarrow.parquet")
OF_CONTROLLER = [
    "K_VE", "B_VE", "b", "controller.b", "rates.ratio", "rates.slow_hz", "rates.fast_hz", "device.mass", "device.delay",
    "filters.lp1.cutoff_hz", "environment.delay",
]  # fmt: skip


def judge_fault(number: int) -> list[Found]:
    """A command for a random spec, and what `verify` or `plot` says of its results."""
    for module in HEAVY:  # what is interrupted while it loads stays broken
        import_module(module)
    draw = Draw([22, number])
    tables, overrides, _ = pair(number) if draw.chance(0.3) else (base(draw), [], {})
    command = draw.of(list(COMMANDS))
    add_questions(draw, tables, command)
    words = [command, "a.toml", *COMMANDS[command](draw, Names(tables))]
    words += [word for override in overrides for word in ("--set", override)]
    if draw.chance(WRONG):
        words += ["--set", f"{draw.of(list(QUESTIONS))}={draw.of(ODD)}"]
    if command not in ("check", "explore"):
        words += ["--out", "out", "--overwrite"]
    if command not in ("export", "explore", "report") and draw.chance(0.2):
        words += ["--json"]
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        Path("a.toml").write_text(toml(tables))
        code, said = run(words)
        found = [Found(command, code in ENDS and not FAULT.search(said), words, f"{code}: {said[-900:]}")]
        results = sorted(Path("out").glob("*.csv")) if code == 0 else []
        if results and command not in ("check", "report", "export"):
            words = draw.of((["verify", "out"], ["plot", str(draw.of(results)), "--format", "svg"]))
            code, said = run(words)
            as_found = code in (0, 130) or "found none" in said  # a table without rows has no figure
            found.append(Found(words[0], as_found, [command, *words], f"{code}: {said[-900:]}"))
    return found


def run(words: list[str]) -> tuple[int, str]:
    """How a command ends, and what it prints."""
    printed = io.StringIO()
    code = 130
    with redirect_stdout(printed), redirect_stderr(printed), limited(SECONDS):
        code = main(words)
    return code, printed.getvalue()


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Interrupt what takes more processor time, again and again."""

    def stop(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.2)
    try:
        with suppress(KeyboardInterrupt):
            yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


class Names:
    """What options may name: numbers, blocks, signals and ends of a spec."""

    def __init__(self, tables: dict):
        blocks = [*tables.get("block", {})]
        wires = " ".join(map(str, tables.get("wire", {}).values()))
        ports = tables.get("ports", {})
        self.numbers = [*tables.get("numbers", {}), "rates.tick_hz"] if blocks else OF_CONTROLLER
        self.blocks = blocks or ["velocity", "lp1", "avatar", "hp", "local", "wall", "v_1_kept"]
        self.signals = re.findall(r"[a-z]\w*\.[a-z]\w*", wires) or [f"{block}.y" for block in self.blocks]
        self.inputs = [*ports.get("inputs", {}), "push", "f_h"]
        self.outputs = [*ports.get("outputs", {}), *self.signals, "x", "v", "f_m", "F_s"]


def odd(draw: Draw, names: list[str]) -> str:
    return draw.of(ODD) if draw.chance(WRONG) else draw.of(names)


def in_turn(*words: list[str]):
    """One of these lists of options."""
    return lambda draw, names: draw.of(words) if names else []


def named(option: str, kind: str):
    """An option with a name of a kind, or none."""
    return lambda draw, names: [option, odd(draw, getattr(names, kind))] if draw.chance(0.6) else []


def of_hands(draw: Draw, names: Names) -> list[str]:
    del names
    words = draw.of(([], [], ["--proof"], ["--for-hands", draw.of(("box", "passive", "port", "none", "x"))]))
    return [*words, *draw.of(([], ["--jobs", "1"], ["--no-plot"], ["--no-plot", "--restart"]))]


def of_region(draw: Draw, names: Names) -> list[str]:
    if draw.chance(0.4):
        return of_hands(draw, names)
    plane = ",".join(odd(draw, names.numbers) for _ in range(2))
    return ["--map", plane, "--open", draw.of(("0.5", "0.9", "0", "nan"))]


def of_check(draw: Draw, names: Names) -> list[str]:
    picture = ["--plot", "--out", "out"]
    one = ["--controller", odd(draw, names.blocks)]
    return draw.of(([], ["--all"], ["--strict"], ["--proof", "--out", "out"], picture, one))


COMMANDS = {
    "check": of_check,
    "zwidth": of_hands,
    "stability-region": of_region,
    "margins": named("--cut", "signals"),
    "poles": named("--over", "numbers"),
    "passivity": named("--along", "numbers"),
    "why": named("--along", "numbers"),
    "simulate": in_turn([], ["--no-plot"]),
    "bode": in_turn([], ["--no-plot"]),
    "export": named("--controller", "blocks"),
    "design": in_turn(["--jobs", "1"]),
    "report": named("--cut", "signals"),
    "explore": in_turn(["--save", "out.html"]),
}


def of_require(draw: Draw, names: Names) -> dict:
    """One or two requirements."""
    level = {"at_most": draw.of((0.2, 1.5, 30, 0, -1))}
    way = {"from": odd(draw, names.inputs), "to": odd(draw, names.outputs)}
    cut = {"cut": odd(draw, names.signals), draw.of(("phase_deg", "gain", "disk", "Ms")): draw.of((0.5, 1.5, 30))}
    some = {"radius": 0.97, "damping_ratio": 0.1, "settling": 2.0, "time_constant": 1.0, "margins": draw.of((cut, [cut, cut]))}
    some |= dict.fromkeys(("gain", "peak", "overshoot", "step_settling", "rms"), way | level)
    return {name: some[name] for name in (draw.of(list(some)) for _ in range(draw.whole(1, 2)))}


def of_bode(draw: Draw, names: Names) -> dict:
    if draw.chance(0.5):
        return {"from": odd(draw, names.inputs), "to": odd(draw, names.outputs)}
    return {"frequency_hz": [0, 1, 20], odd(draw, names.numbers): [1, 2]}


def of_simulate(draw: Draw, names: Names) -> dict:
    del names
    forces = ("step", "pulse", "sine", "noise", "x")
    return {"input": draw.of(forces), "at_s": 0.02, "duration_s": draw.of((0.1, 1)), "wall": draw.of((0.01, -1))}


def of_design(draw: Draw, names: Names) -> dict:
    wishes = ("z_width", "damping_ratio", "felt", "settling", "delay_margin", "largest", "port")
    wish = {draw.of(wishes): draw.of(({}, {"at_least": 1}))}
    return {"population": 8, "generations": 1, "vary": {odd(draw, names.numbers): {"start": 1, "stop": 20}}, "wish": wish}


QUESTIONS = {"sweep.require": of_require, "bode": of_bode, "simulate": of_simulate, "design": of_design}


def add_questions(draw: Draw, tables: dict, command: str) -> None:
    """Tables that commands read, most of them as the program takes them."""
    names = Names(tables)
    for name, question in QUESTIONS.items():
        if draw.chance(0.9 if name == command else 0.2):
            table, _, inner = name.partition(".")
            more = question(draw, names)
            inside = tables.get(table, {}) | ({inner: more} if inner else more)
            if draw.chance(WRONG) or taken(tables | {table: inside})[0] is not None:
                tables[table] = inside
