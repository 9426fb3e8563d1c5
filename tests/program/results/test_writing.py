"""All files of a table appear or none does, other people's results stay, and blocks leave no trace."""

import hashlib

import numpy as np
import pytest

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.program.results import publish, read_table
from wavesweep.program.tables.table import Table


def contents(directory):
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in directory.rglob("*") if file.is_file()}


def draw(path):
    path.write_bytes(b"a figure")


def test_equal_runs_give_equal_bytes(columns, facts, tmp_path):
    for name, seconds in (("a", 1.0), ("b", 2.0)):
        publish(Table.of("zwidth", columns, {**facts, "timings": {"total": seconds}}), tmp_path / name)
    first, second = contents(tmp_path / "a"), contents(tmp_path / "b")
    assert {name for name in first if first[name] != second[name]} == {"zwidth.datapackage.json"}


@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_an_infinity_is_refused_by_column_and_row_and_nothing_is_written(columns, facts, tmp_path, value):
    columns["high"][2] = value
    with pytest.raises(WavesweepError, match=rf"column high, row 3: found {value}"):
        publish(Table.of("zwidth", columns, facts), tmp_path / "new")
    assert not (tmp_path / "new").exists()


FULL = "No space left on device"


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, FULL), (28, FULL)),
        (OSError(f"Error writing bytes to file. Detail: [errno 28] {FULL}"), (28, FULL)),  # Arrow's way to say so
        (ValueError("no such colour"), None),
    ],
)
def test_a_figure_that_cannot_be_drawn_leaves_nothing_and_says_what_to_do(columns, facts, tmp_path, error, said):
    def fail(path):
        path.write_bytes(b"half")
        raise error

    with pytest.raises(type(error)) as caught:
        publish(Table.of("zwidth", columns, facts, figure=fail), tmp_path)
    assert list(tmp_path.iterdir()) == []
    if said:
        assert (caught.value.errno, caught.value.strerror, caught.value.filename) == (*said, str(tmp_path))
    else:
        assert "--no-plot writes the table without it" in caught.value.__notes__[0]


def test_a_run_that_fails_half_way_keeps_the_old_results(columns, facts, tmp_path):
    publish(Table.of("zwidth", columns, facts), tmp_path)
    before = contents(tmp_path)

    def interrupted():
        yield columns
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        publish(Table("zwidth", interrupted, facts), tmp_path)
    assert contents(tmp_path) == before


def test_results_of_another_spec_stay_without_overwrite(columns, facts, tmp_path):
    publish(Table.of("zwidth", columns, facts, figure=draw), tmp_path)
    before, other = contents(tmp_path), {**facts, "spec_sha256": "cd" * 32}
    with pytest.raises(UsageError, match="give --overwrite"):
        publish(Table.of("zwidth", columns, other), tmp_path)
    assert contents(tmp_path) == before
    publish(Table.of("zwidth", columns, other), tmp_path, overwrite=True)
    # The old figure shows the other spec's results: it must not stand beside these.
    assert not (tmp_path / "zwidth.png").exists()


@pytest.mark.parametrize("package", [None, "{ torn", "[]", '{"wavesweep": {}}'])
def test_files_of_unknown_origin_stay(columns, facts, tmp_path, package):
    (tmp_path / "zwidth.csv").write_text("mine\n")
    if package is not None:
        (tmp_path / "zwidth.datapackage.json").write_text(package)
    with pytest.raises(UsageError, match="unknown origin"):
        publish(Table.of("zwidth", columns, facts), tmp_path)
    assert (tmp_path / "zwidth.csv").read_text() == "mine\n"


def test_a_byte_that_was_changed_is_noticed_though_the_size_is_the_same(columns, facts, tmp_path):
    publish(Table.of("zwidth", columns, facts), tmp_path)
    csv = tmp_path / "zwidth.csv"
    csv.write_bytes(csv.read_bytes()[:-2] + bytes([csv.read_bytes()[-2] ^ 1]) + b"\n")
    with pytest.raises(UsageError, match="torn or was changed"):
        read_table(csv)
