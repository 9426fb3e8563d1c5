"""A spec has a value for every key, the same from a file and from a dict, and a digest of what was asked for."""

import json
import pickle

import pytest

from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.spec import load

LOOP = {"controller": {"kind": "pmw"}}
FULL = """
[rates]        # the clocks
fast_hz = 2000
slow_hz = 50.0
[controller]
kind = "pmw-lm"
b = 40
[filters]
lp1 = { order = 6 }
lp2 = { passband_hz = 10, stopband_hz = 40, passband_db = 1, stopband_db = 40 }
[sweep]
along = "B_VE"
B_VE = { start = 0, stop = 15 }
"device.damping" = [0.5, 1]
b = { start = 1, stop = 100, num = 3, scale = "log" }
[bode]
frequency_hz = [1, 10.5]
Kp = [0, 20]
"""


@pytest.fixture
def full(tmp_path):
    path = tmp_path / "full.toml"
    path.write_text(FULL)
    return load(path)


def test_a_file_is_read(full, tmp_path):
    assert (full.name, full.source, full.along) == ("full", str(tmp_path / "full.toml"), "B_VE")
    assert full.values["rates.ratio"] == 40
    assert full.values["controller.b"] == 40.0
    assert (full.values["filters.lp1.order"], full.values["filters.lp1.cutoff_hz"]) == (6, 10.0)
    assert full.values["filters.lp2.order"] == 4
    assert full.frequency_hz == (1.0, 10.5)
    names = [(axis.name, axis.path, axis.values) for axis in full.sweep]
    assert names == [
        ("B_VE", "environment.B_VE", ()),
        ("device.damping", "device.damping", (0.5, 1.0)),
        ("b", "controller.b", (1.0, 10.0, 100.0)),
    ]
    assert [axis.name for axis in full.bode] == ["Kp"]
    assert (full.sweep[0].start, full.sweep[0].stop) == (0.0, 15.0)


def test_resolved_tables_load_to_the_same_spec():
    spec = load(LOOP | {"sweep": {"along": "Kp", "Kp": {"start": 0, "stop": 9}, "b": [3, 2], "rates": {"ratio": [5]}}})
    assert load(spec.tables()).tables() == spec.tables()
    assert json.loads(json.dumps(spec.tables())) == spec.tables()


def test_the_digest_is_of_what_is_asked_for_not_of_how_it_is_written():
    digest = load(LOOP).sha256
    assert len(digest) == 64
    same = [{"rates": {"slow_hz": 50}}, {"device": {"mass": 0.1}}, {"environment": {"B_VE": 1}}, {"sweep": {}}]
    assert {load(LOOP | tables).sha256 for tables in same} == {digest}
    other = [{"sweep": {"b": [1, 2]}}, {"sweep": {"b": [2, 1]}}, {"device": {"mass": 0.2}}, {"bode": {"b": [1, 2]}}]
    assert len({digest, *(load(LOOP | tables).sha256 for tables in other)}) == 5


def test_specs_travel_between_processes_and_cannot_be_changed(full):
    copy = pickle.loads(pickle.dumps(full))  # noqa: S301 - made on the line
    assert copy.sha256 == full.sha256
    assert copy.sweep == full.sweep
    with pytest.raises(TypeError):
        full.values["device.mass"] = 1.0
    with pytest.raises(AttributeError):
        full.name = "other"


@pytest.mark.parametrize("content", [b"", b"\n\n", b"# nothing\n", b"\xef\xbb\xbf"])
def test_an_empty_file_lacks_only_the_kind(content, tmp_path):
    path = tmp_path / "empty.toml"
    path.write_bytes(content)
    with pytest.raises(SpecError) as error:
        load(path)
    assert [mistake.key for mistake in error.value.mistakes] == ["controller.kind"]
    assert str(error.value).startswith(f"{path}:1:1: controller.kind: expected one of")


def test_byte_order_mark_and_windows_line_ends_do_no_harm(tmp_path):
    path = tmp_path / "windows.toml"
    path.write_bytes(b'\xef\xbb\xbf[controller]\r\nkind = "dc"\r\n[device]\r\nmass = 0\r\n')
    with pytest.raises(SpecError) as error:
        load(path)
    assert str(error.value) == f"{path}:4:8: device.mass: expected a number > 0, found 0"


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (b"[rates]\nratio = " + b"9" * 5000, ":2:9: expected a number of at most 4300 digits, found more"),
        (b"[rates]\nratio = " + b"[" * 5000, ": expected a TOML file"),
        (b"\x00", ":1:1: expected a TOML file"),
        ("# Gr\u00f6\u00dfe\r\n# caf\u00e9".encode("latin-1"), ":1:5: expected text in UTF-8"),
        ("# Gr\u00f6\u00dfe\r\n# caf".encode() + b"\xe9", ":2:6: expected text in UTF-8"),
        ("[rates]".encode("utf-16"), ":1:1: expected text in UTF-8"),
    ],
)
def test_what_is_no_toml_is_a_mistake_with_its_place(content, place, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises(SpecError) as error:
        load(path)
    assert str(error.value).startswith(f"{path}{place}")
    assert ", found " in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_files_that_cannot_be_read_say_why(tmp_path):
    cases = {
        tmp_path / "none.toml": "No such file or directory",
        tmp_path: "expected a file, found a folder",
        "nul\0.toml": "cannot be read",
    }
    for path, words in cases.items():
        with pytest.raises(UsageError, match=words) as error:
            load(path)
        assert not isinstance(error.value, SpecError)
