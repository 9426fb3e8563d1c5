"""Rows of columns that doubles leave in doubt and balls prove."""

import pytest
from stability.test_meeting import line

import wavesweep
from wavesweep import capabilities
from wavesweep.program.cli import main
from wavesweep.program.results.verification import verify

SPEC = """
[rates]
tick_hz = 1000.0
[numbers]
p = 1.0
q = 1.0
[block.g]
type = "ss"
discrete = true
A = [[-0.5, 2.25, 0.0], [0.0, 1.0, 0.0], [-2.9999999999999982, 4.499999999999999, 0.9999999999999991]]
B = [[0.5], [0.0], [1.0]]
C = [[3.125, -2.25, -0.75]]
D = [[0.0]]
[wire]
"g.u" = "-p*q*g.y"
[sweep]
along = "p"
p = { start = 0.2, stop = 0.4 }
q = [0.3, 0.4]
"""


pytestmark = pytest.mark.slow


def test_rows_that_are_proved_in_balls_are_as_others_and_are_found_again(tmp_path):
    """A mode whose number 0.3 keeps it on the circle but for 1e-16."""
    (tmp_path / "mine.toml").write_text(SPEC)
    command = ["stability-region", str(tmp_path / "mine.toml"), "--out", str(tmp_path), "--no-plot", "--quiet"]
    assert main(command) == 0
    lines = (tmp_path / "stability-region.csv").read_text().splitlines()
    assert [line.split(",")[8] for line in lines[1:]] == ["1", "1"]
    assert verify(tmp_path).differences == ()


def test_what_doubles_leave_in_doubt_stays_so_without_balls(monkeypatch):
    """The least mass before a sampled damper, where two eigenvalues meet: doubles do not prove it."""
    with_balls, without = (wavesweep.compile(line(2, K=13.0, b=100.2)) for _ in range(2))
    assert with_balls.stable_intervals("m", (0.003, 10.0)).certified.all()
    monkeypatch.setattr(capabilities, "CAPABILITIES", [each for each in capabilities.CAPABILITIES if each.name != "prove"])
    assert not without.stable_intervals("m", (0.003, 10.0)).certified.any()
