"""`export` writes the files of a controller, and never over others."""

import json
from pathlib import Path

import pytest

FILES = ["controller.h", "controller.c", "check.c", "example.c", "vectors.csv", "Makefile"]
SHORT = ("--set", "simulate.duration_s=0.05", "--set", "simulate.settle_s=0")


def test_the_files_go_to_a_folder_of_the_specs_name(wavesweep, spec):
    code, out, err = wavesweep("export", spec, *SHORT)
    assert (code, out) == (0, "")
    said = " ".join(err.split())
    folder = Path("results/wall,simulate.duration_s=0.05,simulate.settle_s=0/c")
    assert sorted(file.name for file in folder.iterdir()) == sorted(FILES)
    assert f"wall, pmw: vectors of 50 ticks; `make -C {folder} check` compares every bit" in said
    assert "assumes: implicit integration of the wall, no delay, exact velocity" in said
    assert f"Wrote {folder}/{', '.join(FILES)} in " in err
    assert "from the spec wall, SHA-256" in (folder / "controller.h").read_text()


def test_existing_files_are_replaced_only_with_force(wavesweep, spec, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "Makefile").write_text("all:\n")
    code, _, err = wavesweep("export", spec, *SHORT, "--out", "mine")
    assert (code, err) == (
        2,
        "Error: mine/Makefile: the file exists; expected another --out DIR, or --overwrite to replace the files\n",
    )
    assert [file.name for file in (tmp_path / "mine").iterdir()] == ["Makefile"]
    assert wavesweep("export", spec, *SHORT, "--out", "mine", "--overwrite", "--quiet") == (0, "", "")
    assert "check:" in (tmp_path / "mine" / "Makefile").read_text()


@pytest.mark.parametrize("settings", [(), ("--set", "simulate.wall=0.01", "--set", "controller.kind=dc-lm")])
def test_the_vectors_are_the_rows_of_simulate(settings, wavesweep, spec):
    from wavesweep.program import results

    wavesweep("export", spec, *SHORT, *settings, "--out", "mine", "--quiet")
    wavesweep("simulate", spec, *SHORT, *settings, "--out", "there", "--quiet", "--no-plot")
    columns = results.read("there/simulate.parquet")
    names, *rows = [line.split(",") for line in Path("mine/vectors.csv").read_text().splitlines()]
    assert (names[0], names[-1], len(rows)) == ("tick", "ws_device_f", 50)
    of = {"ws_device_x": columns["x"], "ws_device_v": columns["v"], "ws_device_f": -columns["f_m"]}
    for place, name in enumerate(names[1:], 1):
        assert [float.fromhex(row[place]) for row in rows] == of[name].tolist()


def test_what_goes_into_each_output_is_told_and_stands_beside_it(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("grip.toml").write_text(GRIP)
    said = wavesweep("export", "grip.toml", *SHORT)[2]
    assert "computed from samples, in C: motor.f = -kp*net.y - kh*motor.x (coefficients -200, -300)\n" in said
    terms = " *   motor.f = -kp*net.y - kh*motor.x\n *     -200 times net.y\n *     -300 times motor.x\n"
    assert terms in next(Path("results").glob("grip,*/c/controller.h")).read_text()
    spring = ("--set", 'block.grip={type="spring", k="kh"}', "--set", "wire.grip.x1=motor.x")
    wires = ("--set", "wire.motor.f=push - kp*net.y + grip.f1", "--overwrite", "--json")
    summary = json.loads(wavesweep("export", "grip.toml", *SHORT, *spring, *wires)[1])
    assert summary["computed"] == {"motor.f": "-kp*net.y"}
    assert summary["terms"] == {"motor.f": [{"from": "net.y", "gain": "-kp", "coefficient": -200.0}]}


GRIP = """
[rates]
tick_hz = 1000
[numbers]
kp = 200.0
kh = 300.0
[block.motor]
type = "mass"
mass = 0.1
damping = 3
[block.net]
type = "delay"
[wire]
"net.u" = "motor.x"
"motor.f" = "push - kp*net.y - kh*motor.x"
[ports]
hand = { force = "push", displacement = "motor.x" }
"""
