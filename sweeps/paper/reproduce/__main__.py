"""Make the paper's figures again, and test its statements: `python sweeps/paper/reproduce`, in two minutes of one processor.

A table and a figure for each of Figures 2, 4, 5, 6, 7 and 8; open-choices, with the values that the paper leaves open;
passive-bank, with filter banks whose returned waves pass a passive map; and statements, with a verdict and its numbers.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from reproduce import counted, tables
from wavesweep.engine.errors import WavesweepError
from wavesweep.program.results import publish


def main(words: Sequence[str] | None = None) -> None:
    """Write all tables and figures, the statements last, and say how many of these have which verdict."""
    parser = argparse.ArgumentParser(prog="python sweeps/paper/reproduce", description=__doc__.partition("\n")[0])
    parser.add_argument("--out", default="results/paper", help="folder of the tables and figures (default: %(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace results of other specs there")
    options = parser.parse_args(words)
    try:
        for table in tables():
            print(*publish(table, options.out, options.overwrite), sep="\n")
    except WavesweepError as error:
        parser.error(str(error))
    print(counted(table.columns))


if __name__ == "__main__":
    main()
