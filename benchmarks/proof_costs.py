"""What proof files cost: CPU s to write one and to check it, and its size, for each kind of claim.

`python benchmarks/proof_costs.py` (a minute or two; the tables themselves are computed as well, and not counted);
`--all` also Fig. 4 with all of its 151 slices.
"""

import contextlib
import io
import sys
import tempfile
import time
from pathlib import Path

from wavesweep.checker.__main__ import main as check
from wavesweep.program.cli import main as command
from wavesweep.proofs import of_table

SWEEPS = Path(__file__).parents[1] / "sweeps"
FRAMES = """[environment]
integration = "explicit"
step = "elapsed"
[device]
velocity = "difference"
[controller]
kind = "dc-slow"
[for_all]
"rates.ratio" = { values = [16, 20, 33], varying = true }
[sweep]
K_VE = { start = 0, stop = 20000 }
"""
BOX = """[environment]
integration = "explicit"
[device]
velocity = "difference"
[controller]
kind = "pmw"
b = 10.0
[for_all]
"device.mass" = { start = 0.08, stop = 0.125 }
[sweep]
K_VE = { start = 0, stop = 20000 }
"""
CASES = {  # what: spec, command, options
    "three slices of Fig. 4": (SWEEPS / "paper/fig4.toml", "zwidth", ["--set", "sweep.B_VE=[1,5,15]"]),
    "three frames in any order": (FRAMES, "zwidth", []),
    "a box of masses": (BOX, "zwidth", []),
    "lost = 1": (SWEEPS / "recipes/lost-commands.toml", "stability-region", ["--set", "sweep.n=[1]"]),
    "mean square": (
        SWEEPS / "recipes/random-loss.toml",
        "stability-region",
        ["--set", "sweep.p=[0.05]", "--set", "sweep.b=[0]"],
    ),
    "map of Fig. 4": (SWEEPS / "paper/fig4.toml", "stability-region", ["--map", "K_VE,B_VE", "--open", "0.05"]),
}
WHOLE = {"Fig. 4, 151 slices": (SWEEPS / "paper/fig4.toml", "zwidth", [])}


def main(arguments: list[str]) -> None:
    spent = []
    for name in ("with_proof", "of_map"):
        setattr(of_table, name, timed(getattr(of_table, name), spent))
    print(f"{'':26} {'write, CPU s':>12} {'check':>6} {'claims':>7} {'kB':>6}")
    for what, (spec, name, options) in (CASES | (WHOLE if "--all" in arguments else {})).items():
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "spec.toml"
            place.write_text(spec if isinstance(spec, str) else spec.read_text(encoding="utf-8"), encoding="utf-8")
            words = [name, str(place), "--proof", "--no-plot", "--jobs", "1", "--quiet", "--out", folder, *options]
            assert not command(words)
            (proof,) = Path(folder).glob("*.proof")
            said = io.StringIO()
            start = time.process_time()
            with contextlib.redirect_stdout(said):
                code = check([str(place), str(proof)])
            checked = time.process_time() - start
            size = proof.stat().st_size / 1000
        claims = said.getvalue().splitlines()[-1].removesuffix(" claims proved")
        print(
            f"{what:26} {sum(spent):12.2f} {checked:6.2f} {claims:>7} {size:6.0f}{'' if code == 0 else ' REFUSED'}", flush=True
        )
        spent.clear()


def timed(function, spent):
    def inner(*arguments):
        start = time.process_time()
        found = function(*arguments)
        spent.append(time.process_time() - start)
        return found

    return inner


if __name__ == "__main__":
    main(sys.argv[1:])
