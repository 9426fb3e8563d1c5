"""Every command that computes says that it is at work, if that takes long."""

import pytest

from wavesweep.program.cli import messages

SPEC = """
[controller]
kind = "pmw"
b = 30
[sweep]
K_VE = { start = 0, stop = 2000 }
B_VE = [1]
[bode]
frequency_hz = [1, 2]
[simulate]
duration_s = 0.1
[design]
population = 8
generations = 1
[design.vary]
b = { start = 20, stop = 40 }
[design.wish]
z_width = { at_least = 100, B_VE = [1] }
"""
COMMANDS = ("zwidth", "bode", "why", "margins", "poles", "simulate", "design", "passivity", "check", "report")


@pytest.fixture
def mine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(SPEC)


@pytest.mark.sample(4)
@pytest.mark.slow
@pytest.mark.usefixtures("mine")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_that_takes_long_says_that_it_is_at_work(command, wavesweep, monkeypatch):
    no_plot = ["--no-plot"] * (command not in ("check", "report"))
    monkeypatch.setattr(messages, "FIRST_WORD", 1e-6)
    code, _, err = wavesweep(command, "mine.toml", *no_plot)
    assert code == 0
    assert "still at work" in err
    if command == "zwidth":
        assert wavesweep(command, "mine.toml", *no_plot, "--quiet") == (0, "", "")
        assert "still computing rows again" in wavesweep("verify", "results/mine")[2]
