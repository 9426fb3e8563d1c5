"""The law of rewriting: a spec and the same spec written in other words have the same answers of every command.

Nothing here knows what a spec means: a rewriting replaces a text by one that is the same by algebra, or by the documents.
"""

import re
from collections.abc import Callable, Iterator
from copy import deepcopy

import numpy as np
from meaning.judge import compiled
from meaning.required import Found
from meaning.sets_rewritten import holds_as_channels, mass_as_inertia, ratio_as_rate, steps_as_seconds, ticks_as_seconds
from meaning.specs import Draw, controller, drawing, toml

from wavesweep.checker.reader.classes import written_out

SAME = 1e-7  # relative: of answers that other roundings give as well
SAME_PLACE = 1e-4  # the same of frequencies: that of a peak is known to the root of its bound
ONE_OUTPUT = {"gain", "hold", "lowpass", "butterworth", "lead", "notch", "biquad", "fir", "mean", "integrator", "difference"}
NO_NUMBERS = ("type", "inputs", "outputs", "axes", "discrete", "method", "pass", "missing", "integration", "gives", "file")


def rewritten(number: int) -> tuple[dict, dict, list[str]]:
    """A random spec, the same rewritten, and how: each way by a chance of a half."""
    draw = Draw([6, number])
    tables = drawing(number) if number % 4 else controller(number, quick=True)
    ways = OF_DRAWINGS if number % 4 else OF_CONTROLLERS
    changed = deepcopy(tables)
    applied = []
    for way in ways:
        if draw.chance(0.5):
            before = deepcopy(changed)
            changed = way(changed, draw)
            if toml(changed) != toml(before):
                applied.append(way.__name__)
    return tables, changed, applied


def names_inlined(tables: dict, draw: Draw) -> dict:
    """Names of [signals] as their expressions in brackets."""
    del draw
    signals = tables.pop("signals", {})
    for _ in signals:  # names within names
        for name, text in signals.items():
            tables = _replaced(tables, name, f"({text})")
            signals = {key: re.sub(_whole(name), f"({text})", other) for key, other in signals.items()}
    return tables


def names_given(tables: dict, draw: Draw) -> dict:
    """What a wire reads as a name of [signals]."""
    ports = [port for port, text in tables["wire"].items() if isinstance(text, str) and "dt" not in text]
    port = draw.of(ports)
    tables.setdefault("signals", {})["given"] = tables["wire"][port]
    tables["wire"][port] = draw.of(("given", "1*given", "-(-given)"))
    return tables


def numbers_as_expressions(tables: dict, draw: Draw) -> dict:
    """Keys of blocks as products, or as numbers of [numbers]."""

    def written(value):
        if isinstance(value, list):
            return [written(each) for each in value]
        if isinstance(value, (bool, np.bool_, str)) or not value or draw.chance(0.5):
            return value
        if draw.chance(0.5):
            return f"2*({value!r})/2"
        name = f"q{len(tables['numbers'])}"
        tables["numbers"][name] = value
        return name

    for keys in tables["block"].values():
        if f"type.{keys['type']}" in tables:  # a key may be a block of the class
            continue
        for key, value in keys.items():
            if key not in NO_NUMBERS:
                keys[key] = written(value)
    return tables


def classes_as_copies(tables: dict, draw: Draw) -> dict:
    """Each block of a class as the blocks that it is."""
    del draw
    if "type.watch" not in tables:
        return tables
    tables["type"] = {"watch": tables.pop("type.watch")}
    return written_out(tables)


def blocks_as_classes(tables: dict, draw: Draw) -> dict:
    """A block with one input as a class that has it alone."""
    names = [name for name, keys in tables["block"].items() if keys["type"] in ONE_OUTPUT and "." not in name]
    names = [name for name in names if "dt" not in str(tables["wire"][f"{name}.u"])]
    if not names:
        return tables
    name = draw.of(names)
    keys = tables["block"][name]
    used = {each: value for each, value in tables["numbers"].items() if re.search(_whole(each), str(list(keys.values())))}
    if used:  # of the loop, which a class does not see
        return tables
    inside = {"block": {"inner": keys}, "wire": {"inner.u": "u"}, "ports": {"inputs": ["u"], "outputs": {"y": "inner.y"}}}
    tables["type.copied"] = inside
    tables["block"][name] = {"type": "copied"}
    return tables


def minus_through_a_block(tables: dict, draw: Draw) -> dict:
    """A linear block reads the negative of its input, and all that read it the negative of its output."""
    names = [name for name, keys in tables["block"].items() if keys["type"] in ONE_OUTPUT]
    if not names:
        return tables
    name = draw.of(names)
    tables = _replaced(tables, f"{name}.y", f"(-{name}.y)")
    tables["wire"][f"{name}.u"] = f"-({tables['wire'][f'{name}.u']})"
    return tables


def outputs_seen(tables: dict, draw: Draw) -> dict:
    """Outputs of blocks as outputs of the loop, and as they were before the tick."""
    outputs = tables["ports"].setdefault("outputs", {})
    for name, keys in tables["block"].items():
        if keys["type"] in {*ONE_OUTPUT, "impulse"}:
            outputs[f"seen{len(outputs)}"] = draw.of((f"{name}.y", f"prev({name}.y)", f"2*{name}.y"))
    return tables


def order_shuffled(tables: dict, draw: Draw) -> dict:
    """Blocks and wires in another order."""
    for table in ("block", "wire"):
        keys = list(tables[table])
        draw.random.shuffle(keys)
        tables[table] = {key: tables[table][key] for key in keys}
    return tables


def one_value_listed(tables: dict, draw: Draw) -> dict:
    """A number as an axis of the sweep with one value."""
    del draw
    if "D" in tables.get("numbers", {}):
        tables["sweep"]["D"] = [tables["numbers"]["D"]]
    elif "controller" in tables and tables["sweep"]["along"] != "B_VE":
        tables["sweep"]["B_VE"] = [tables["environment"].get("B_VE", 1.0)]
    return tables


def defaults_written(tables: dict, draw: Draw) -> dict:
    """Keys that are not given with what the documents say of them."""
    del draw
    device = tables.get("device", {})
    if "preset" not in device:
        tables["device"] = {"mass": 0.1, "damping": 1.5, "velocity": "exact", "delay": 0, "dead_time": 0.0} | device
    tables["operator"] = {"mass": 0.0, "damping": 0.0, "stiffness": 0.0} | tables.get("operator", {})
    tables["local_model"] = {"K_LM": 500.0, "B_LM": 0.0, "integration": "implicit", "delay": 1} | tables.get("local_model", {})
    return tables


OF_DRAWINGS: tuple[Callable[[dict, Draw], dict], ...] = (
    names_inlined, classes_as_copies, names_given, minus_through_a_block, numbers_as_expressions, blocks_as_classes,
    outputs_seen, order_shuffled, one_value_listed, steps_as_seconds, mass_as_inertia, holds_as_channels,
)  # fmt: skip
OF_CONTROLLERS = (one_value_listed, defaults_written, ticks_as_seconds, ratio_as_rate)


def _whole(name: str) -> str:
    return rf"(?<![\w.]){re.escape(name)}(?![\w.])"


def _replaced(tables: dict, name: str, text: str) -> dict:
    """The tables with a text in place of a signal in all expressions."""

    def within(value):
        if isinstance(value, dict):
            return {key: within(inner) for key, inner in value.items()}
        return re.sub(_whole(name), text, value) if isinstance(value, str) else value

    changed = {table: within(tables[table]) for table in ("wire", "signals") if table in tables}
    changed["ports"] = {**tables["ports"]}
    if "outputs" in tables["ports"]:
        changed["ports"]["outputs"] = within(tables["ports"]["outputs"])
    return tables | changed


def answers(tables: dict, folder, push: np.ndarray, more: bool) -> Iterator[tuple[str, np.ndarray]]:
    """What the commands say of a spec: names of answers, and their numbers. more: passivity and margins too."""
    loop = compiled(toml(tables), folder)
    yield "radius", np.array([float(loop.spectral_radius())])
    rows = loop.stable_intervals()
    if (rows["doubt"] == "").all():  # which is of roundings
        yield "stable intervals", rows[["low", "high"]].to_numpy().ravel()
    poles = loop.poles()
    sizes = np.hypot(poles["z_re"], poles["z_im"]).to_numpy()
    yield "poles", np.sort(sizes[sizes > 1e-2])
    response = loop.response([3.7])
    yield "bode", response[["admittance_re", "admittance_im"]].to_numpy().ravel()
    yield "simulate", loop.simulate(push)["x"].to_numpy()
    if more:
        yield "passivity", np.nan_to_num(loop.passivity().filter(["margin"]).to_numpy(float)).ravel()
    signals = " ".join(tables.get("signals", {}).values())
    cut = tables.get("block", {}).get("c0", {"type": "impulse"})["type"] != "impulse"  # whose readers may read its sum
    if more and cut and "c0" not in signals and loop.spectral_radius() < 1:
        for name in ("c0.y", "c0.y1"):
            if re.search(_whole(name), str(tables["wire"].values())):
                found = loop.margins(name)
                yield f"margins at {name}", found["value"].to_numpy()
                yield f"places of margins at {name}", found[["omega", "hz"]].to_numpy().ravel()
                return


def judge_rewritten(number: int, folder) -> list[Found]:
    """The answers of a spec and of the same rewritten."""
    tables, changed, applied = rewritten(number)
    push = np.random.default_rng(number).normal(size=40)
    more = number % 10 == 1
    theirs = dict(answers(changed, folder, push, more))
    found = []
    for what, values in answers(tables, folder, push, more):
        if what in theirs:
            others = theirs[what]
            size = np.nanmax(abs(values), initial=0.0)
            near = SAME_PLACE if what.startswith("places") else SAME
            same = values.shape == others.shape and np.allclose(values, others, rtol=near, atol=1e-9 * size, equal_nan=True)
            found.append(Found(f"rewritten {what}", bool(same), values, (applied, others)))
    return found
