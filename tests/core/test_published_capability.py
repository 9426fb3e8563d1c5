"""A capability of another package: its command, its columns, its table and its figure are there once it is installed."""

import os
import subprocess
import sys

FILES = {
    "decays/__init__.py": """
from wavesweep.capabilities import Capability

DECAYS = Capability("decays", {"decay": "Compute how slowly a loop decays."}, kinds=("decay",), package="decays")
""",
    "decays/columns.py": """
from wavesweep.core.tables.fields import Field

COLUMNS = {"decay": (Field("time_constant", "number", "s", "time in which the slowest mode falls to 1/e"),)}
""",
    "decays/table.py": """
import numpy as np
import wavesweep
from wavesweep.core.tables.kind import whole_kind
from wavesweep.core.tables.table import Table, facts_of


def decay(spec):
    loop = wavesweep.compile(spec)
    frame = spec.values["rates.ratio"] / spec.values["rates.fast_hz"]
    decays = np.array([-frame / np.log(float(loop.spectral_radius()))])
    return Table.of("decay", {"time_constant": decays}, facts_of([spec], {}, {"computed": 1}, {}))


KINDS = (
    whole_kind(
        "decay",
        lambda columns, _: {"time_constant": float(columns["time_constant"][0])},
        lambda numbers: iter([(f"falls to 1/e in {numbers['time_constant']:.3g} s", False)]),
        "decays.figure.decay",
    ),
)
""",
    "decays/figure.py": """
from wavesweep.core.plots.style import figure


def decay(columns, facts):
    with figure(3.5, 2.0) as canvas:
        canvas.subplots().plot(columns["time_constant"], "o")
    return canvas
""",
    "decays/command.py": '''
import click
from wavesweep.core.cli.options import Options, run_options


@click.command("decay")
@click.argument("spec")
@run_options()
def decay(spec: str, options: Options) -> None:
    """Compute how slowly a loop decays."""
    from decays.table import decay as computed
    from wavesweep.core.cli.output import produce

    produce(["decay"], [spec], options, lambda specs, **_: [computed(specs[0])])
''',
    "decays-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: decays\nVersion: 1.0\n",
    "decays-1.0.dist-info/entry_points.txt": "[wavesweep.capabilities]\ndecays = decays:DECAYS\n",
}


def test_a_capability_of_another_package_is_there_once_it_is_installed(tmp_path):
    for name, text in FILES.items():
        (tmp_path / "site" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "site" / name).write_text(text, encoding="utf-8")
    (tmp_path / "wall.toml").write_text('[controller]\nkind = "dc"\n[environment]\nK_VE = 100.0\n', encoding="utf-8")

    def run(*words):
        path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
        arguments = [sys.executable, "-m", "wavesweep", *words]
        return subprocess.run(
            arguments, cwd=tmp_path, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
        )

    assert "Compute how slowly a loop decays." in " ".join(run("--help").stdout.split())
    done = run("decay", "wall.toml", "--out", "out")
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert "falls to 1/e in" in done.stderr
    header, row = (tmp_path / "out" / "decay.csv").read_text(encoding="utf-8").split()
    assert header == "time_constant"
    assert 0 < float(row) < 10
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".csv", ".parquet", ".png", ".json"}
    assert "time in which the slowest mode falls to 1/e" in run("explain", "time_constant").stdout
