"""The controller of a drawn loop in C: its blocks and sums without the device, each kind of tick as straight lines.

The device are the blocks whose inputs are held over a tick in any case: masses, and continuous models. They are the host's.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep import __version__
from wavesweep.analysis.simulation import hand_force
from wavesweep.analysis.simulation.drawn import Blocks, Tick, kinds_of, run_drawn
from wavesweep.diagram.assembly import assembled
from wavesweep.diagram.drawn import Drawn
from wavesweep.errors import UsageError
from wavesweep.export.text import constants, factor, filled, table_of
from wavesweep.spec import Spec
from wavesweep.sweep.simulation_table import simulation_of

MOST_TERMS = 50_000  # in all kinds of ticks together; each is a product in the source
MOST_KINDS = 255


def exported_drawn(spec: Spec) -> dict[str, str]:
    """Return the files of the controller of a drawn loop in C: name -> text. spec: see `exported`.

    Errors: `UsageError` if the loop has no device, nothing but a device, or one that responds within the tick, or too many
    terms.
    """
    ticks = len(simulation_of(spec).signals["x"])
    drawn, plants = assembled(spec.drawing, spec.values), [block.name for block in spec.drawing.blocks if block.plant]
    _refuse(drawn, plants)
    controller, outputs = _controller(drawn, plants)
    given = _given(spec, drawn, controller.inputs, ticks)
    seen = run_drawn(controller, given, outputs)
    ticks = min(len(column) for column in seen.values())
    if not ticks:
        raise UsageError("export: expected an experiment with at least one tick for the vectors, found none")
    names = _identifiers([*controller.inputs, *outputs])
    flags, values = _values(spec, controller, outputs, plants, names)
    columns = {"tick": np.arange(ticks)} | {names[name]: column[:ticks] for name, column in (given | seen).items()}
    return {
        "controller.h": filled("drawn.h", flags, values),
        "controller.c": filled("guards.c", flags, values) + filled("drawn.c", flags, values),
        "check.c": filled("check_drawn.c", flags, values),
        "example.c": filled("example_drawn.c", flags, values | _host(drawn, plants, controller, outputs, names)),
        "vectors.csv": table_of(columns),
        "Makefile": filled("Makefile", flags, {}),
    }


def _refuse(drawn: Drawn, plants: Sequence[str]) -> None:
    """Raise UsageError if the loop is not a device, whose outputs are states, and a controller."""
    if not plants or len(plants) == len(drawn.placed):
        found = "nothing else" if plants else "none"
        raise UsageError(f"export: expected a device (blocks of type mass, ss or tf) and further blocks, found {found}")
    at_once = [each.block.name for each in drawn.placed if each.block.name in plants and np.any(each.block.D)]
    if at_once:
        found = f"block.{at_once[0]} with direct terms"
        raise UsageError(f"export: expected a device whose outputs follow its inputs a tick later, found {found}")


def _controller(drawn: Drawn, plants: Sequence[str]) -> tuple[Drawn, tuple[str, ...]]:
    """The drawing without the device, whose outputs become inputs, and the signals that act on the device."""
    kept = tuple(each for each in drawn.placed if each.block.name not in plants)
    device = [each.block for each in drawn.placed if each.block.name in plants]
    ports = [f"{block.name}.{port}" for block in device for port in block.inputs]
    inner = {port: {s: gain for s, gain in drawn.sums.get(port, {}).items() if s not in drawn.inputs} for port in ports}
    read = [f"{each.block.name}.{port}" for each in kept for port in each.block.inputs]
    sums = {**{port: drawn.sums[port] for port in read if port in drawn.sums}, **inner}
    cut = replace(drawn, placed=kept, sums=sums)
    sources = set().union(*(cut.sources(port) for port in (*read, *ports)))
    measured = [f"{block.name}.{port}" for block in device for port in block.outputs]
    inputs = tuple(name for name in (*measured, *drawn.inputs) if name in sources)
    outputs = tuple(port for port in ports if inner[port])
    if not outputs or not inputs:
        raise UsageError("export: expected a controller that reads the device and acts on it, found one that does not")
    return replace(cut, inputs=inputs), outputs


def _given(spec: Spec, drawn: Drawn, inputs: Iterable[str], ticks: int) -> dict[str, np.ndarray]:
    """The inputs of the controller in the simulated experiment, `(ticks,)` each."""
    force = hand_force(spec.as_simulated()).force[:ticks]
    outside = {name: force if name == spec.drawing.hand[0] else np.zeros(ticks) for name in drawn.inputs}
    seen = run_drawn(drawn, outside, tuple(name for name in inputs if name not in outside))
    return {name: outside.get(name, seen.get(name)) for name in inputs}


def _identifiers(signals: Sequence[str]) -> dict[str, str]:
    """A name in C for each signal, no two the same."""
    found: dict[str, str] = {}
    for signal in signals:
        base = name = re.sub(r"\W", "_", f"_{signal}" if signal[0].isdigit() else signal, flags=re.ASCII)
        count = 1
        while name in found.values():
            count += 1
            name = f"{base}_{count}"
        found[signal] = name
    return found


def _values(spec: Spec, controller: Drawn, outputs: tuple[str, ...], plants: Sequence[str], names: Mapping[str, str]):
    """Flags and texts for the templates' names."""
    kinds, sets = kinds_of(controller, controller.ticks)
    blocks, inputs = Blocks(controller, controller.inputs, outputs), controller.inputs
    ticks, kept = [blocks.tick(running) for running in sets], blocks.width - len(inputs)
    if (terms := sum(len(tick.rows) for tick in ticks)) > MOST_TERMS or len(sets) > MOST_KINDS:
        found = f"{terms} in {len(sets)}"
        raise UsageError(f"export: expected at most {MOST_TERMS} terms in {MOST_KINDS} kinds of ticks, found {found}")
    running = [[controller.placed[j].block.name for j in each] for each in sets]
    rows = [*(f"{name}, change" for name in blocks.names[: blocks.summed]), *blocks.names[blocks.summed : kept], *outputs]
    labels = [*(f"case {i}" for i in range(len(sets) - 1)), "default"]
    texts = {
        "title": "A controller that a spec draws",
        "version": __version__,
        "name": spec.name.replace("*/", "* /"),
        "digest": spec.as_simulated().sha256,
        "tick_ms": f"{1e3 / spec.tick_hz:g}",
        "plants": ", ".join(plants),
        "frame": controller.ticks,
        "columns": "\n".join(f" * {i}: {name}" for i, name in enumerate(blocks.names)),
        "kept": kept,
        "summed": blocks.summed,
        "width": blocks.width,
        "rows": kept + len(outputs),
        "count": len(outputs),
        "ticks": "\n".join(_function(i, tick, who, rows) for i, (tick, who) in enumerate(zip(ticks, running, strict=True))),
        "kinds": "\n".join(f"    {', '.join(map(str, kinds[i : i + 40]))}," for i in range(0, len(kinds), 40)),
        "cases": "\n".join(f"    {each}:\n        tick_{i}(z, y);\n        break;" for i, each in enumerate(labels)),
    }
    numbers = constants({"fast_hz": spec.tick_hz, "T": float(controller.period)})
    return {"memory": kept > 0, "several": len(sets) > 1}, numbers | texts | _signals(inputs, outputs, kept, names)


def _signals(inputs: Sequence[str], outputs: Sequence[str], kept: int, names: Mapping[str, str]) -> dict[str, str]:
    """The texts with a line for each input, or for each output."""
    lines = {
        "inputs": [f"    double {names[name]}; /* {name} */" for name in inputs],
        "outputs": [f"    double {names[name]}; /* {name} */" for name in outputs],
        "given": [f"    z[{kept + i}] = in.{names[name]};" for i, name in enumerate(inputs)],
        "taken": [f"    out.{names[name]} = y[{kept + i}];" for i, name in enumerate(outputs)],
        "read": [f"        in.{names[name]} = strtod(at + 1, &at);" for name in inputs],
        "compared": [f'        compare(out.{names[name]}, strtod(at + 1, &at), "{name}", ticks);' for name in outputs],
    }
    return {name: "\n".join(each) for name, each in lines.items()}


def _function(i: int, tick: Tick, running: Sequence[str], names: Sequence[str]) -> str:
    """The function of one kind of tick: a sum for each row, which begins with 0 and adds product after product."""
    sums = ["0.0"] * tick.count
    for row, column, each in zip(tick.rows.tolist(), tick.columns.tolist(), tick.factors.tolist(), strict=True):
        sums[row] += f" + {factor(each)} * z[{column}]"
    lines = "".join(
        f"    y[{row}] = {terms}; /* {name} */\n" for row, (terms, name) in enumerate(zip(sums, names, strict=True))
    )
    who = (
        f"in which {', '.join(running)} run"
        if len(running) > 1
        else f"in which {running[0]} runs"
        if running
        else "without blocks"
    )
    return f"/* A tick {who}. */\nstatic void tick_{i}(const double *z, double *y)\n{{\n    (void)z;\n{lines}}}\n"


def _host(drawn: Drawn, plants, controller: Drawn, outputs, names: Mapping[str, str]) -> dict[str, Any]:
    """The texts of the device in the example: its outputs, the sums at its inputs and the changes of its states."""
    blocks, q, u = [each.block for each in drawn.placed if each.block.name in plants], 0, 0
    sensed, pushed, moved = [f"        in.{names[name]} = hand;" for name in controller.inputs if name in drawn.inputs], [], []
    for block in blocks:
        for port, row in zip(block.outputs, block.C, strict=True):
            if (name := f"{block.name}.{port}") in controller.inputs:
                sensed.append(f"        in.{names[name]} = {_sum(row, 'q', q)};")
        for k, port in enumerate(block.inputs):
            name = f"{block.name}.{port}"
            own = f"out.{names[name]}" if name in outputs else "0.0"
            gain = sum(float(each) for source, each in drawn.sums.get(name, {}).items() if source in drawn.inputs)
            pushed.append(f"        u[{u + k}] = {own} + {factor(gain)} * hand;")
        for i, (row, force) in enumerate(zip(block.E, block.B, strict=True)):
            moved.append(f"        dq[{q + i}] = {_sum(row, 'q', q)} + {_sum(force, 'u', u)};")
        q, u = q + len(block.states), u + len(block.inputs)
    shown = [f"in.{names[name]}" for name in controller.inputs] + [f"out.{names[name]}" for name in outputs]
    return {
        "size": q,
        "forces": u,
        "header": ",".join(names[name] for name in (*controller.inputs, *outputs)),
        "formats": ",%.17g" * len(shown),
        "printed": ", ".join(shown),
        "sensed": "\n".join(sensed),
        "pushed": "\n".join(pushed),
        "moved": "\n".join(moved),
    }


def _sum(row, array, first):
    return " + ".join(f"{factor(value)} * {array}[{first + i}]" for i, value in enumerate(row.tolist()) if value) or "0.0"
