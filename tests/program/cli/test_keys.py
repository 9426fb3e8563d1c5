"""`keys` explains every key from the one table of keys, as text and as JSON."""

import json

import pytest

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.cli import main
from wavesweep.program.reading.keys import AXIS_KEYS, DEVICES
from wavesweep.program.reading.tables import study_keys
from wavesweep.program.spec import KEYS, SYMBOLS

EVERY = {**KEYS, **study_keys()}


@pytest.mark.whole
def test_every_key_is_listed_with_unit_default_and_meaning(wavesweep, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    code, out, err = wavesweep("keys")
    assert (code, err) == (0, "")
    rows = {line.split()[0]: line for line in out.splitlines() if line}
    for path, key in EVERY.items():
        assert key.description in rows[path]
        assert key.unit in ("", "1") or f" {key.unit} " in rows[path]
        assert key.default is None or str(key.default).lower() in rows[path].lower()  # true or false in TOML
    for study in ("sweep", "bode"):
        assert {f"{study}.AXIS.{part}" for part in AXIS_KEYS} <= rows.keys()
    tables = [line for line in out.splitlines() if line.startswith("[")]
    assert len(tables) == len(set(tables))
    assert {"[sweep]", "[bode]", "[simulate]", "[device]"} <= set(tables)


def test_symbols_are_keys_too(wavesweep):
    for symbol, path in SYMBOLS.items():
        assert wavesweep("keys", symbol) == wavesweep("keys", path)
        assert f"symbol: {symbol}" in wavesweep("keys", symbol)[1]


def test_a_table_and_an_axis_are_explained(wavesweep):
    assert "filters.hp" not in wavesweep("keys", "filters.lp1")[1]
    assert wavesweep("keys", "filters.lp1")[1].count("filters.lp1.") == 6
    out = wavesweep("keys", "sweep.device.mass")[1]
    assert "axis over device.mass" in out
    assert [part for part in AXIS_KEYS if f"sweep.device.mass.{part} " not in out] == []


@pytest.mark.whole
def test_devices_are_listed_with_numbers_and_sources(wavesweep):
    out = wavesweep("keys", "device.preset")[1]
    for device in DEVICES.values():
        assert device.title in out
        for path, number in device.numbers.items():
            mark = "assumed" if number.assumed else "source"
            assert f"{path} = {number.value:g} {EVERY[path].unit}; {mark}: {number.source}" in out
    assert out.count("device.mass: not known") == 3


def test_the_same_as_json(wavesweep):
    code, out, err = wavesweep("keys", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert {path: (found[path]["type"], found[path]["default"]) for path in EVERY} == {
        path: (key.type, key.default) for path, key in EVERY.items()
    }
    assert found["controller.b"]["symbol"] == "b"
    assert found["local_model.delay"]["choices"] == {"0": "", "1": ""}
    assert found["controller.kind"]["choices"] == {kind: each.description for kind, each in CONTROLLERS.items()}
    touch = found["device.preset"]["devices"]["touch"]
    assert touch["numbers"]["device.mass"]["value"] == 0.045
    assert touch["recommended_wall"]["stiffness"] == 400.0
    assert found["device.preset"]["devices"]["omega"]["not_known"] == ["device.mass", "device.damping"]
    assert list(json.loads(wavesweep("keys", "K_VE", "--json")[1])) == ["environment.K_VE"]


def test_the_tables_of_a_drawn_loop_are_explained(capfd):
    assert main(["keys", "block"]) == 0
    said = capfd.readouterr().out
    assert [kind for kind in TYPES if f"\n  {kind}" not in said] == []
    for kind, each in TYPES.items():
        assert main(["keys", f"block.{kind}"]) == 0
        said = capfd.readouterr().out
        assert [key.path for key in each.keys.values() if f"  {key.path}: {key.description}" not in said] == []
        assert main(["keys", f"block.{kind}", "--json"]) == 0
        found = json.loads(capfd.readouterr().out)[f"block.{kind}"]["keys"]
        files = ["file"] if kind == "ss" else []  # which the program reads in place of the block's matrices
        assert list(found) == [*each.keys, "every", "phase", *files]
    for name in ("numbers", "wire", "ports", "rates.tick_hz"):
        assert main(["keys", name]) == 0
        said = capfd.readouterr().out
        assert name in said
        assert ("counterexample" in said) == (name == "numbers")
    assert main(["keys", "block.buterworth"]) == 2
    assert capfd.readouterr().err.strip().endswith("did you mean block.butterworth?")


@pytest.mark.whole
def test_a_table_of_keys_fits_a_terminal(wavesweep, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    _, narrow, _ = wavesweep("keys", "simulate")
    monkeypatch.delenv("COLUMNS", raising=False)
    _, wide, _ = wavesweep("keys", "simulate")
    rows = narrow.split("\nColumns:")[0].splitlines()
    assert max(map(len, rows[: rows.index("")])) <= 80
    assert max(map(len, wide.splitlines())) > 100
    assert narrow.split() == wide.split()
