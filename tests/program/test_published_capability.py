"""A capability of another package: its command, key, columns, table and figure are there once it is installed."""

import os
import subprocess
import sys
from math import exp

import pytest

FILES = {
    "decays/__init__.py": """
from wavesweep.capabilities import Capability

DECAYS = Capability(
    "decays",
    {"decay": "Compute how slowly a loop decays."},
    tables=("decay",),
    kinds=("decay",),
    offers=("keys",),
    package="decays",
)
""",
    "decays/keys.py": """
from wavesweep.program.reading.keys import by_path, positive
from wavesweep.program.reading.tables import TableValue, SpecTable

KEYS = by_path([positive("decay.to", None, "1", "share of its size to which a mode decays, 1/e by default", high=1)])


class Decay(dict, TableValue):
    def written(self):
        return dict(self)


def build(request):
    given = {f"decay.{name}": leaf for name, leaf in request.belongs.below("decay").items()}
    return Decay({path.removeprefix("decay."): value for path, value in request.mistakes.read(KEYS, given).items()})


TABLE = SpecTable(path="decay", build=build, keys=KEYS, always=True)
""",
    "decays/columns.py": """
from wavesweep.program.tables.fields import Field

COLUMNS = {"decay": (Field("decay_time", "number", "s", "time in which the slowest mode falls to the share of [decay]"),)}
""",
    "decays/table.py": """
import numpy as np
import wavesweep
from wavesweep.program.tables.kind import whole_kind
from wavesweep.program.tables.table import Table, facts_of


def decay(spec):
    loop = wavesweep.compile(spec)
    frame = spec.values["rates.ratio"] / spec.values["rates.fast_hz"]
    decays = np.array([frame * np.log(spec.decay.get("to", np.exp(-1))) / np.log(float(loop.spectral_radius()))])
    return Table.of("decay", {"decay_time": decays}, facts_of([spec], {}, {"computed": 1}, {}))


KINDS = (
    whole_kind(
        "decay",
        lambda columns, _: {"decay_time": float(columns["decay_time"][0])},
        lambda numbers: iter([(f"decays in {numbers['decay_time']:.3g} s", False)]),
        "decays.figure.decay",
    ),
)
""",
    "decays/figure.py": """
from wavesweep.program.plots.style import figure


def decay(columns, facts):
    with figure(3.5, 2.0) as canvas:
        canvas.subplots().plot(columns["decay_time"], "o")
    return canvas
""",
    "decays/command.py": '''
import click
from wavesweep.program.cli.options import Options, run_options


@click.command("decay")
@click.argument("spec")
@run_options()
def decay(spec: str, options: Options) -> None:
    """Compute how slowly a loop decays."""
    from decays.table import decay as computed
    from wavesweep.program.cli.output import produce

    produce(["decay"], [spec], options, lambda specs, **_: [computed(specs[0])])
''',
    "decays-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: decays\nVersion: 1.0\n",
    "decays-1.0.dist-info/entry_points.txt": "[wavesweep.capabilities]\ndecays = decays:DECAYS\n",
}


@pytest.mark.slow
def test_a_capability_of_another_package_is_there_once_it_is_installed(tmp_path):
    for name, text in FILES.items():
        (tmp_path / "site" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "site" / name).write_text(text, encoding="utf-8")
    (tmp_path / "wall.toml").write_text('[controller]\nkind = "dc"\n[environment]\nK_VE = 100.0\n', encoding="utf-8")

    def run(*arguments, site=str(tmp_path / "site")):
        path = os.pathsep.join([site, os.environ.get("PYTHONPATH", "")])
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": path},
            capture_output=True,
            text=True,
            check=False,
        )

    done = run("-m", "wavesweep", "decay", "wall.toml", "--out", "out")
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert "decays in" in done.stderr
    header, row = (tmp_path / "out" / "decay.csv").read_text(encoding="utf-8").split()
    assert header == "decay_time"
    assert 0 < float(row) < 10
    lines = ["--help", "keys decay.to", "zwidth wall.toml --set decay.to=2"]
    lines += [f"decay wall.toml --set decay.to={exp(-2)} --no-plot --quiet --out -"]
    said = run("-c", f"from wavesweep.program.cli import main\nfor line in {lines!r}:\n    main(line.split())")
    assert "Compute how slowly a loop decays." in " ".join(said.stdout.split())
    assert "share of its size to which a mode decays" in said.stdout
    assert "decay.to: expected a number <= 1, found 2" in said.stderr
    assert float(said.stdout.split()[-1]) == pytest.approx(2 * float(row), rel=1e-9)
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".csv", ".parquet", ".png", ".json"}
    assert "time in which the slowest mode falls to the share" in (tmp_path / "out" / "decay.datapackage.json").read_text()

    # Without the package its tables are drawn plainly, with a word.
    for suffix in ("csv", "parquet"):
        done = run("-m", "wavesweep", "plot", f"out/decay.{suffix}", "--out", f"{suffix}.svg", site="")
        assert done.returncode == 0, done.stderr
        assert f"decay.{suffix}: drawn plainly, since the capability that makes tables of wavesweep decay is not" in done.stderr
        assert "Drawn plainly" in (tmp_path / f"{suffix}.svg").read_text()

    # A hook with a name that nobody asks for would be silent.
    (tmp_path / "site/decays/__init__.py").write_text(FILES["decays/__init__.py"].replace('"keys",', '"keys", "on_check"'))
    (tmp_path / "site/decays/on_check.py").write_text("def line(spec, found):\n    yield 2, 'decays'\n")
    done = run("-m", "wavesweep", "check", "wall.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("Error: capability decays: expected some of numbers, facts, lines")
    assert done.stderr.endswith("in decays.on_check, found line; did you mean lines?\n")
