"""Tables of a spec belong to capabilities; the core reads every spec without them."""

import subprocess
import sys

import pytest

from wavesweep.capabilities import CAPABILITIES, TABLES
from wavesweep.engine.errors import SpecError
from wavesweep.engine.keys import Key
from wavesweep.program.reading.tables import SpecTable, tables
from wavesweep.program.spec.schema import schema
from wavesweep.program.spec.studies import value_of

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


def test_a_table_is_read_written_and_described_by_its_keys_alone(monkeypatch):
    band = Key.several(Key.gain("heat.at.band_hz", None, "Hz", "where it is measured"), 2, rising=True)
    keys = Key.by_path(
        [Key.positive("heat.rise", None, "K", "of the motor"), Key.word("heat.by", "air", "what cools", ("air", "oil")), band]
    )
    table = SpecTable(path="heat", keys=keys, always=True)
    monkeypatch.setattr("wavesweep.program.spec.studies.table_at", {"heat": table}.get)
    monkeypatch.setattr("wavesweep.program.spec.schema.tables", lambda: {"heat": table})
    given = {"rise": 40, "at": {"band_hz": [1, 20]}}
    assert value_of("heat", given).written() == {"rise": 40.0, "at": {"band_hz": [1.0, 20.0]}}
    for wrong, said in (
        ({"rise": 0}, "heat.rise: expected a number > 0, found 0"),
        ({"ries": 1}, "heat.ries: expected one of rise, by, at.band_hz, found an unknown key; did you mean `rise`?"),
        ({"at": 3}, "heat.at: expected a table with some of at.band_hz, found 3"),
        ({"at": {"band_hz": [5, 5]}}, "heat.at.band_hz: expected the lower frequency first, found [5, 5]"),
        ({"at": {"band_hz": [5]}}, "heat.at.band_hz: expected [lowest, highest frequency], found a list"),
    ):
        with pytest.raises(SpecError) as error:
            value_of("heat", wrong)
        assert str(error.value) == said
    shape = schema()["then"]["properties"]["heat"]["properties"]
    assert shape["by"]["enum"] == ["air", "oil"]
    assert shape["at"]["properties"]["band_hz"] == {
        "description": "where it is measured (Hz)",
        "type": "array",
        "items": {"minimum": 0.0, "type": "number"},
        "minItems": 2,
        "maxItems": 2,
    }
