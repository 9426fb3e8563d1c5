"""The fronts of this folder in one figure: run `wavesweep design` on each spec first, then this from the top folder.

for name in plain gains front passive free; do
    wavesweep design sweeps/design/$name.toml
    wavesweep design sweeps/design/$name.toml --set environment.integration=implicit --set environment.delay=0 \
        --out results/$name-implicit
done
python sweeps/design/fronts.py
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pandas

NAMES = {
    "plain": "plain waves",
    "gains": "local model, gains alone",
    "front": "gains and filters",
    "passive": "plain waves, passive channel",
    "free": "gains and filters, no hand",
}
WALLS = {"": "explicit wall, a tick late", "-implicit": "implicit wall, no delay"}
LOOKS = ("o-", "s-", "D-", "^--", "v:")


def draw(results: Path, target: Path) -> None:
    """Draw the `design` tables in the folders below `results`."""
    fig, both = plt.subplots(1, 2, figsize=(8.6, 3.6), layout="constrained", sharex=True, sharey=True)
    for axes, (suffix, title) in zip(both, WALLS.items(), strict=True):
        for (name, words), look in zip(NAMES.items(), LOOKS, strict=True):
            found = results / f"{name}{suffix}" / "design.csv"
            if found.exists():
                table = pandas.read_csv(found).sort_values("z_width")
                axes.plot(table.z_width, table.transparency, look, markersize=3.5, linewidth=0.9, label=words)
        axes.set_title(title, fontsize=10)
        axes.set_xscale("log")
        axes.set_xlabel("stiffest wall (N/m), more is better")
        axes.grid(visible=True, which="both", color="0.9", linewidth=0.5)
    both[0].set_ylabel("error of the response, less is better")
    both[1].legend(*both[0].get_legend_handles_labels(), fontsize=8, loc="upper left")
    fig.savefig(target, dpi=150)


if __name__ == "__main__":
    draw(Path("results"), Path(__file__).with_name("fronts.png"))
