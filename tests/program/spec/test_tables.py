"""Tables of a spec belong to capabilities; the core reads every spec without them."""

import subprocess
import sys

import pytest

from wavesweep.capabilities import CAPABILITIES, TABLES
from wavesweep.program.reading.tables import tables

ALONE = """
from wavesweep import capabilities
capabilities.CAPABILITIES = ()
from wavesweep.program.cli import main
raise SystemExit(main(["bode", "a.toml", "--no-plot", "--quiet", "--set", "bode.frequency_hz=[1]"]))
"""


def test_the_lines_of_capabilities_name_the_tables_that_they_read():
    assert {path for each in CAPABILITIES for path in each.tables} == {*tables()}


@pytest.mark.slow
@pytest.mark.sample(2)
@pytest.mark.parametrize("table", TABLES)
def test_a_table_of_a_capability_that_is_not_there_is_one_mistake_that_names_it(table, write):
    write(f'[controller]\nkind = "dc"\n\n[{table}]\nanything = {{ whatever = 1 }}\nother = 2\n')
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, check=False)
    found = f"found a table of the capability {TABLES[table]}, which is not installed"
    expected = f"[{table}]: expected only tables of what is installed, {found}"
    assert (done.returncode, done.stderr.splitlines()) == (2, [f"a.toml:4:2: {expected}"])


@pytest.mark.slow
def test_the_core_alone_reads_a_spec_and_answers(write):
    write('[controller]\nkind = "dc"\n\n[sweep]\nB_VE = [1.0]\n')
    done = subprocess.run([sys.executable, "-c", ALONE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
