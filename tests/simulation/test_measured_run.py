"""`simulate --log`: inputs from a log, what was measured beside the simulation, and by how much they differ."""

import numpy as np
import pytest

from wavesweep.program import results
from wavesweep.program.spec import load
from wavesweep.simulation.measured_run import read_run

T = 0.001
SERVO = """
[rates]
tick_hz = 1000
[block.motor]
type = "mass"
mass = 0.2
damping = 1.0
[block.law]
type = "hold"
every = 2
[wire]
"law.u" = "40*(ref - motor.x) - 2*motor.v"
"motor.f" = "law.y - load"
[ports.inputs]
ref = { signal = "ref", unit = "m" }
load = { signal = "load", unit = "N" }
[ports.outputs]
place = { signal = "motor.x", unit = "m" }
[simulate]
from = "ref"
"""
EXACT = np.exp(-5 * T)  # of the speed over a tick


def run(ref, load):
    """The position of a march of the same loop."""
    x = v = held = 0.0
    seen = []
    for k in range(len(ref)):
        if k % 2 == 0:
            held = 40 * (ref[k] - x) - 2 * v
        seen.append(x)
        end = held - load[k]  # of the speed, as the damping is 1
        x, v = x + end * T + (v - end) * (1 - EXACT) / 5, end + (v - end) * EXACT
    return np.array(seen)


def logged(tmp_path, every=3, header="stamp [ms],command (mm),push,enc_mm", offset=0.0):
    """A spec, a log with every so many ticks of a run, and this run."""
    ticks = np.arange(0, 600, every)
    ref, load = np.where(ticks >= 90, 0.02, 0.0), np.where(ticks >= 300, 0.5, 0.0)
    held = np.repeat(ref, every)[:600], np.repeat(load, every)[:600]
    seen = run(*held)
    rows = zip(1e3 * T * ticks + 5e4, 1e3 * ref, load, 1e3 * (seen[ticks] + offset), strict=True)
    (tmp_path / "log.csv").write_text("\n".join([header, *(",".join(map(repr, map(float, row))) for row in rows), ""]))
    (tmp_path / "servo.toml").write_text(SERVO)
    return ticks, seen


NAMED = ("--column", "time=stamp", "--column", "ref=command", "--column", "load=push", "--column", "place=enc")


def test_a_log_of_the_loop_itself_is_its_simulation(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ticks, seen = logged(tmp_path, offset=1e-4)
    code, _, said = wavesweep("simulate", "servo.toml", "--log", "log.csv", *NAMED, "--no-plot", "--out", "beside")
    assert code == 0
    assert "place: simulated and measured differ by 0.0001 in the root mean square" in said
    assert "command (mm) is taken as ref in mm, times 0.001" in said
    columns = results.read("beside/simulate.parquet")
    np.testing.assert_allclose(columns["place"], seen[: len(columns["place"])], rtol=0, atol=1e-12)
    np.testing.assert_allclose(columns["log_place"][ticks], seen[ticks] + 1e-4, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(columns["log_place"][ticks[:-1] + 2], columns["log_place"][ticks[:-1]])
    assert columns["load"][299:301].tolist() == [0.0, 0.5]
    assert len(columns["tick"]) == ticks[-1] + 1
    assert wavesweep("verify", "beside")[0] == 0


@pytest.mark.slow
def test_the_log_is_drawn_over_the_simulation(tmp_path):
    from wavesweep.simulation.figure import simulate as drawn
    from wavesweep.simulation.table import simulate

    _, seen = logged(tmp_path, every=1, offset=1e-4)
    named = {"time": "stamp", "ref": "command", "load": "push", "place": "enc"}
    (table,) = simulate(load(tmp_path / "servo.toml").asking("simulate"), tmp_path / "log.csv", named)
    canvas = drawn(table.columns, table.facts)
    (panel,) = [axes for axes in canvas.axes if axes.get_ylabel().startswith("place")]
    lines = {line.get_label(): line.get_ydata() for line in panel.get_lines()}
    np.testing.assert_allclose(lines["place, measured"][:600] - lines["place"][:600], 1e-4, rtol=0, atol=1e-12)
    np.testing.assert_allclose(lines["place"][:600], seen, rtol=0, atol=1e-12)


def test_another_load_is_seen_in_the_difference(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    logged(tmp_path)
    args = ("servo.toml", "--set", "block.motor.mass=0.3", "--log", "log.csv", *NAMED, "--no-plot", "--out", "there")
    _, _, said = wavesweep("simulate", *args)
    (line,) = [line for line in said.replace("\n    ", " ").splitlines() if "differ" in line]
    worst, when = float(line.split("at most")[0].split("by ")[-1]), float(line.split(" at ")[-1].removesuffix(" s"))
    columns = results.read("there/simulate.parquet")
    off = np.abs(columns["place"] - columns["log_place"])[::3]
    assert worst == pytest.approx(off.max(), rel=1e-3)
    assert when == pytest.approx(3 * T * off.argmax(), rel=1e-3)
    assert worst > 1e-3


def test_rows_count_from_the_tick_next_to_them_on(tmp_path):
    (tmp_path / "log.csv").write_text("t,ref,place\n7.0000,0,0\n7.0026,1,2\n7.0034,3,4\n7.0100,5,6\n")
    (tmp_path / "servo.toml").write_text(SERVO)
    found = read_run(tmp_path / "log.csv", {}, {"place": 10.0}, load(tmp_path / "servo.toml"))
    assert found.inputs["ref"].tolist() == [0, 0, 0, 3, 3, 3, 3, 3, 3, 3, 5]
    assert found.outputs["place"].tolist() == [0, 0, 0, 40, 40, 40, 40, 40, 40, 40, 60]
    assert np.flatnonzero(found.fresh).tolist() == [0, 3, 10]


@pytest.mark.parametrize(
    ("args", "problem"),
    [
        (("--column", "time=stamp", "--column", "ref=command"), "log.csv: expected a column of an output (place), found stamp"),
        (("--column", "plce=enc"), "--column plce: expected one of time, ref, load, place, found plce; did you mean place?"),
        (("--column", "ref=comand"), "enc_mm; did you mean --column 'ref=command (mm)'?"),
        (("--column", "time=command", *NAMED[2:]), "log.csv: command (mm): expected s, found mm"),
    ],
    ids=["no output", "a slip", "a column's slip", "another dimension"],
)  # fmt: skip
def test_a_log_that_cannot_be_used_is_one_clear_line(args, problem, wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    logged(tmp_path)
    code, _, said = wavesweep("simulate", "servo.toml", "--log", "log.csv", *args)
    assert code == 2
    assert problem in said


def test_columns_without_a_log_are_refused(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    logged(tmp_path)
    assert "--column: expected --log, whose column it names" in wavesweep("simulate", "servo.toml", *NAMED)[2]
