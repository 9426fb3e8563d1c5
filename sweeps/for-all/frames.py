"""What is left of each controller's walls if the environment does not keep its rate: one figure, and a line for each best one.

Computes the specs of this folder for both steps and both delays; takes two minutes on an idle machine. From the top folder:

OPENBLAS_NUM_THREADS=1 python sweeps/for-all/frames.py
"""

from collections.abc import Iterator
from itertools import product
from pathlib import Path

import matplotlib
import pandas as pd

import wavesweep

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.transforms import ScaledTranslation

FOLDER = Path(__file__).parent
STEPS = {"elapsed": "step: time since the last frame", "nominal": "step: always 20 ms"}
DELAYS = {"1": "result after 1 ms", "frame": "result with the next frame"}
LOOKS = {  # colour, mark of what is proved, line of a constant rate
    "fig4": ("#56B4E9", "o", (0, (1, 1)), "waves, LP1 at 8.57 Hz (fig4)"),
    "pmw": ("#0072B2", "s", (0, (5, 1)), "waves, LP1 at 3 Hz (pmw)"),
    "pmw-lm": ("#D55E00", "D", (0, (5, 1, 1, 1)), "the same with a local model (pmw-lm)"),
    "dc-slow": ("#009E73", "v", (0, (2, 1)), "direct coupling (dc-slow)"),
}


def computed() -> pd.DataFrame:
    """The rows of `wavesweep zwidth` of all loops; column `guarantee` tells those of a constant rate from those for all."""
    return pd.concat(list(_tables()), ignore_index=True)


def _tables() -> Iterator[pd.DataFrame]:
    for name, step, delay in product(LOOKS, STEPS, DELAYS):
        spec = wavesweep.load(FOLDER / f"{name}.toml", [f"environment.step={step}", f"environment.delay={delay}"])
        yield wavesweep.zwidth(spec).assign(name=name, step=step, delay=delay)


def draw(table: pd.DataFrame, target: Path) -> None:
    """Draw what is proved, not known and refuted over b, and the limits of a constant rate beside it."""
    fig, grid = plt.subplots(2, 2, figsize=(7.6, 6), layout="constrained", sharex=True, sharey=True)
    for axes, (step, delay) in zip(grid.flat, product(STEPS, DELAYS), strict=True):
        for place, (name, look) in enumerate(LOOKS.items()):
            rows = table[(table["name"] == name) & (table.step == step) & (table.delay == delay) & (table.interval == 0)]
            _draw_one(axes, rows, look, place)
        axes.set_title(f"{STEPS[step]}\n{DELAYS[delay]}", fontsize=9)
        axes.set(xscale="log", yscale="log", xlim=(4.5, 45), xticks=[5, 10, 20, 40], xticklabels=["5", "10", "20", "40"])
        axes.set_ylim(0.8 * table.high.min(), 1.25 * table.high.max())  # shifted dots do not count for matplotlib's own limits
        axes.minorticks_off()
        axes.grid(visible=True, color="0.9", linewidth=0.5)
    fig.supxlabel("wave impedance b (N·s/m)", fontsize=9)
    fig.supylabel("stiffest wall K_VE (N/m), of B_VE = 1 N·s/m", fontsize=9)
    handles = [
        plt.Line2D([], [], color=colour, marker=mark, markersize=4, linestyle=line, linewidth=1, label=words)
        for colour, mark, line, words in LOOKS.values()
    ]
    handles += [
        plt.Line2D([], [], linestyle="none", label="marks: proved for 16, 20, 25, 33 ms in any order"),
        plt.Line2D([], [], color="0.3", linewidth=2.5, linestyle=(0, (0.4, 0.4)), label="not known"),
        plt.Line2D([], [], color="0.3", marker=10, markersize=5, linestyle="none", label="refuted from here by a pattern"),
        plt.Line2D([], [], linestyle="none", label="lines: constant rate, frames of 20 ms"),
    ]
    fig.legend(handles=handles, loc="outside upper center", ncols=2, fontsize=8, handlelength=3)
    fig.savefig(target, dpi=110)


def _draw_one(axes, rows: pd.DataFrame, look: tuple, place: int) -> None:
    colour, mark, line, _ = look
    own, proved = (rows[rows.guarantee == word] for word in ("spec", "for_all"))
    if alike := "b" not in rows or bool(rows.b.isna().all()):  # the same for every b
        own, proved = (pd.concat([part.assign(b=4.5), part.assign(b=45.0)]) for part in (own, proved))
    axes.plot(own.b, own.high, linestyle=line, color=colour, linewidth=1)
    shift = axes.transData + ScaledTranslation(2.5 * (place - 1.5) / 72, 0, axes.figure.dpi_scale_trans)
    at = {"color": colour, "transform": shift}
    axes.vlines(proved.b, proved.high, proved.fails_from, linewidth=2.5, linestyle=(0, (0.4, 0.4)), **at)
    axes.plot(proved.b, proved.high, marker=mark, linestyle="-" if alike else "none", markersize=4, **at)
    axes.plot(proved.b, proved.fails_from, linestyle="none", marker=10, markersize=5, **at)


def said(table: pd.DataFrame) -> Iterator[str]:
    """Yield a line for the stiffest wall that is proved for each spec, step and delay."""
    for (step, delay, name), rows in table.groupby(["step", "delay", "name"]):
        own, proved = (rows[(rows.guarantee == word) & (rows.intervals > 0)] for word in ("spec", "for_all"))
        best = proved.loc[proved.high.idxmax()]
        at = f" (b = {best.b:g})" if best.b == best.b else ""
        yield (
            f"{name}, step {step}, delay {delay}: proved to {best.high:.1f} N/m{at}, refuted from "
            f"{best.fails_from:.1f}; constant rate {own.high.max():.1f}, felt {own.felt_high.max():.1f}"
        )


if __name__ == "__main__":
    found = computed()
    print("\n".join(said(found)))  # noqa: T201 - a program for the command line
    draw(found, FOLDER / "frames.png")
