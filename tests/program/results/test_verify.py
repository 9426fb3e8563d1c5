"""`wavesweep verify` finds every kind of difference between a folder of results, its packages and new rows."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest

from wavesweep.engine.errors import UsageError
from wavesweep.program import results
from wavesweep.program.cli import main
from wavesweep.program.results import publish
from wavesweep.program.results.verification import verify
from wavesweep.program.spec import load
from wavesweep.program.tables.hand_rows import hands_of
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.response_table import responses
from wavesweep.program.tables.table import Table

TABLES = {
    "device": {"velocity": "difference", "damping": 3.0},
    "operator": {"stiffness": 50.0},
    "controller": {"kind": "pmw"},
    "sweep": {
        "along": "K_VE",
        "K_VE": {"start": 0, "stop": 20000},
        "B_VE": [0.5, 1, 2],
        "Kp": [0, 20],
        "environment.delay": [0, 3],
    },
    "bode": {"frequency_hz": [0, 1, 10], "Kp": [0, 20]},
}
SIMULATED = {"simulate": {"input": "sine", "frequency_hz": 5, "amplitude": 1, "duration_s": 1}}


ALONG_B = {"along": "b", "b": {"start": 5, "stop": 50}, "B_VE": [0.5, 1, 2]}


def of(capability):
    """The tables of a capability, if it is there."""
    return pytest.importorskip(f"wavesweep.{capability}.table")


def files_of(spec, kind):
    """The tables of a kind, computed."""
    short = replace(spec, name="short")
    calls = {
        "zwidth": lambda: [intervals(spec, "K_VE", jobs=1)],
        "hands": lambda: [
            replace(
                intervals(
                    load(TABLES | {"sweep": TABLES["sweep"] | {"B_VE": [1]}}),
                    "K_VE",
                    of("passive") and hands_of(["passive", "port"]),
                    jobs=1,
                ),
                kind="zwidth-hands",
            )
        ],
        "stability-region": lambda: [replace(intervals(load(TABLES | {"sweep": ALONG_B}), jobs=1), kind="stability-region")],
        "bode": lambda: [responses([short])],
        "two specs": lambda: [responses([short, replace(load(TABLES | {"bode": {"frequency_hz": [1]}}), name="other")])],
        "passivity": lambda: [of("passive").passivity(spec, 0.01, jobs=1)],
        "why": lambda: [of("sensitivity").why(load(TABLES | {"sweep": ALONG_B}))],
        "margins": lambda: [of("margins").margins(load(TABLES | {"environment": {"K_VE": 50}}), "avatar.out")],
        "simulate": lambda: of("simulation").simulate(replace(load(TABLES | SIMULATED), name="short").asking("simulate")),
    }
    return calls[kind]()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["zwidth", "simulate"])
def test_results_as_they_were_written_have_no_differences(kind, tmp_path):
    tables = files_of(load(TABLES), kind)
    for table in tables:
        publish(table, tmp_path)
    found = verify(tmp_path)
    assert found.differences == ()
    assert len([text for text in found.checked if "computed again, equal to " in text]) == len(tables)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    publish(intervals(load(TABLES), "K_VE", jobs=1), folder)
    return folder


@pytest.fixture
def folder(written, tmp_path):
    return shutil.copytree(written, tmp_path / "o")


def package_of(folder):
    return json.loads((folder / "zwidth.datapackage.json").read_text())


def repackaged(folder, **facts):
    """Write other facts into the package."""
    package = package_of(folder)
    package["wavesweep"] |= facts
    (folder / "zwidth.datapackage.json").write_text(json.dumps(package))


def flip(folder):
    content = bytearray((folder / "zwidth.csv").read_bytes())
    digit = max(at for at, letter in enumerate(content[:-20]) if chr(letter).isdigit())
    content[digit] ^= 1
    (folder / "zwidth.csv").write_bytes(content)


def cut_off(folder):
    content = (folder / "zwidth.parquet").read_bytes()
    (folder / "zwidth.parquet").write_bytes(content[:-30])


def lose(folder):
    (folder / "zwidth.csv").unlink()


def tear(folder):
    (folder / "zwidth.datapackage.json").write_text('{"wave')


def change_a_number(folder):
    """In both files, with the hashes of the changed files in the package."""
    columns, facts = results.read(folder / "zwidth.parquet"), package_of(folder)["wavesweep"]
    columns["high"] = columns["high"].copy()
    columns["high"][5] *= 1 - 1e-8
    publish(Table.of("zwidth", columns, facts), folder)


def lose_a_row(folder):
    columns, facts = results.read(folder / "zwidth.parquet"), package_of(folder)["wavesweep"]
    publish(Table.of("zwidth", {name: column[:-1] for name, column in columns.items()}, facts), folder)


def change_the_spec(folder):
    repackaged(folder, spec=package_of(folder)["wavesweep"]["spec"] | {"device": {"mass": 0.2}})


def break_the_spec(folder):
    repackaged(folder, spec={"device": {"mass": -1}})


def lose_the_numbers(folder):
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(folder / "zwidth.parquet")
    pyarrow.parquet.write_table(table.drop_columns(["interval"]), folder / "zwidth.parquet")


def lose_the_schema(folder):
    flip(folder)
    package = package_of(folder)
    del package["resources"][0]["schema"]
    (folder / "zwidth.datapackage.json").write_text(json.dumps(package))


def overwrite(folder):
    (folder / "zwidth.parquet").write_bytes(b"")


DAMAGES = {
    lose_the_numbers: ["zwidth.parquet and zwidth.csv: columns ", "computed again, no column interval"],
    lose_the_schema: ["zwidth.datapackage.json: cannot be read as a data package", "expected the columns of the table"],
    overwrite: ["zwidth.*: a table cannot be read: ", "cannot be held against new ones: "],
    flip: ["zwidth.csv: ", "in the package", "zwidth.parquet and zwidth.csv: row "],
    cut_off: ["zwidth.parquet: ", "cannot be read", "cannot be held against new ones"],
    lose: ["zwidth.csv: No such file"],
    tear: ["zwidth.datapackage.json: cannot be read as a data package"],
    change_a_number: ["zwidth.parquet: computed again, row 6, column high: "],
    lose_a_row: ["computed again, 11 combinations and not 12"],
    change_the_spec: ["the digest of the spec in it is ", "computed again, "],
    break_the_spec: ["the spec in it makes no run: "],
}


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGES)
def test_every_kind_of_damage_is_named(folder, damage, capfd):
    damage(folder)
    assert main(["verify", str(folder), "--quiet"]) == 1
    out, err = capfd.readouterr()
    assert out == ""
    assert [text for text in DAMAGES[damage] if text not in err] == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_whatever_is_flipped_or_edited_in_a_package_is_found(folder, seed, monkeypatch):
    monkeypatch.setattr("wavesweep.program.results.verification._again", lambda *_: None)
    package, random = folder / "zwidth.datapackage.json", np.random.default_rng(seed)
    whole = package.read_bytes()
    assert verify(folder).differences == ()
    for _ in range(60):
        flipped = bytearray(whole)
        flipped[random.integers(len(whole))] ^= 1 << random.integers(8)
        package.write_bytes(flipped)
        assert verify(folder).differences, bytes(flipped)
    content = json.loads(whole)
    places = list(leaves({name: each for name, each in content.items() if name != "hash"}))
    for at in random.permutation(len(places))[:60]:
        edited = json.loads(whole)
        *way, last = places[at]
        inner = reduce(lambda inner, step: inner[step], way, edited)
        if random.integers(2):
            del inner[last]
        else:
            inner[last] = {"a": 1} if isinstance(inner[last], str) else "other"
        package.write_text(json.dumps(edited, indent=2) + "\n")
        said = " ".join(verify(folder).differences)
        assert str(package) in said or "in the package" in said, places[at]


def leaves(value, way=()):
    """The way to each number, text or flag of a JSON value."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for step, each in inner:
        yield from leaves(each, (*way, step)) if isinstance(each, (dict, list)) else [(*way, step)]


def test_an_edit_is_named_with_its_place_and_what_belongs_there(folder, monkeypatch):
    monkeypatch.setattr("wavesweep.program.results.verification._again", lambda *_: None)
    package = folder / "zwidth.datapackage.json"
    content = json.loads(package.read_text())
    fields = content["resources"][0]["schema"]["fields"]
    at = next(number for number, field in enumerate(fields) if field["name"] == "low")
    fields[at]["unit"] = "N/mm"
    package.write_text(json.dumps(content, indent=2) + "\n")
    assert verify(folder).differences == (f'{package}: resources[0].schema.fields[{at}].unit is "N/mm", not "N/m"',)


def test_a_package_that_asks_for_other_numbers_of_rows_has_none_computed(tmp_path, monkeypatch):
    """Somebody else's spec may ask for any number of them."""
    (table,) = files_of(load(TABLES), "bode")
    publish(table, tmp_path)
    package = json.loads((tmp_path / "bode.datapackage.json").read_text())
    package["wavesweep"]["spec"]["bode"]["frequency_hz"] = {"start": 1, "stop": 50, "num": 1_000_000}
    (tmp_path / "bode.datapackage.json").write_text(json.dumps(package))
    monkeypatch.setattr("wavesweep.program.tables.response_table.responses", lambda *_, **__: pytest.fail("rows were computed"))
    assert "6 rows and not 2000000" in verify(tmp_path).differences[-1]


def test_a_file_of_a_few_bytes_and_many_rows_is_refused_by_its_metadata(folder, monkeypatch):
    import pyarrow.parquet

    row = pyarrow.parquet.read_table(folder / "zwidth.parquet").slice(0, 1)
    many = row.take(pyarrow.array(np.zeros(300_000, int)))
    pyarrow.parquet.write_table(many, folder / "zwidth.parquet", compression="zstd")
    assert (folder / "zwidth.parquet").stat().st_size < 50_000
    monkeypatch.setattr(pyarrow.parquet.ParquetFile, "read_row_groups", lambda *_, **__: pytest.fail("rows were read"))
    said = verify(folder).differences
    assert len([text for text in said if "expected groups of at most 131072 rows, found one of 300000" in text]) == 2
    monkeypatch.setattr(pyarrow.parquet.ParquetFile, "read", lambda *_, **__: pytest.fail("rows were read"))
    monkeypatch.setattr("wavesweep.program.results.table_files.memory", lambda: 1e7)
    with pytest.raises(UsageError, match="expected a table that fits into memory, found 300,000 rows"):
        results.read(folder / "zwidth.parquet")


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero")], ids=["pipe", "device"])
@pytest.mark.parametrize("name", ["zwidth.datapackage.json", "zwidth.csv", "zwidth.parquet"])
def test_a_pipe_or_a_device_in_place_of_a_file_is_waited_for_by_no_command(columns, facts, tmp_path, make, name):
    (tmp_path / "wall.toml").write_text('[controller]\nkind = "dc"\n[sweep]\nB_VE = [1]\n')
    publish(Table.of("zwidth", columns, facts), tmp_path / "out")
    (tmp_path / "out" / name).unlink()
    make(tmp_path / "out" / name)
    program = "from wavesweep.program.cli import main\n"
    for words in ("zwidth wall.toml --no-plot --out out", "verify out", f"plot out/{name.replace('datapackage.json', 'csv')}"):
        program += f"print(main({words.split()}))\n"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout.split("\n")[:1] == ["2"]
    assert (done.stdout.split()[-1], "Traceback" in done.stderr, "fault of wavesweep" in done.stderr) == ("2", False, False)
    assert name in done.stdout + done.stderr
