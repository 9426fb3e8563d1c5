"""Commands run in this process, over a sweep that answers at once."""

from dataclasses import dataclass, field
from importlib.util import find_spec

import numpy as np
import pytest

from support.tables import rows_of
from wavesweep.program.cli import main
from wavesweep.program.sweep import estimates
from wavesweep.program.tables.table import Table

SPEC = """
[controller]
kind = "pmw"
[sweep]
K_VE = { start = 0, stop = 20000 }
B_VE = [0.5, 1.0]
"""


@dataclass
class Calls:
    """The calls that the commands made, and what the next one fails with, if it shall fail."""

    seen: list = field(default_factory=list)
    forgotten: list = field(default_factory=list)
    fail: BaseException | None = None

    def note(self, name, **given):
        """Remember a call."""
        self.seen.append((name, given))
        if self.fail is not None:
            raise self.fail


def facts_of(specs):
    return {
        "schema_version": 1,
        "tool_version": "0.1.0",
        "spec": specs[0].tables(),
        "spec_sha256": specs[0].sha256,
        "methods": {},
        "slices": {"computed": 2, "skipped": 0, "certified": 2},
        "timings": {"total": 0.1},
    }


def intervals_table():
    return rows_of(
        "zwidth",
        3,
        B_VE=[0.5, 1.0, 1.0],
        along=["K_VE"] * 3,
        intervals=[1, 2, 2],
        interval=[0, 0, 1],
        low=[0.0, 0.0, 2523.335],
        high=[700.0, 799.713, 4448.819],
        low_omega=[np.nan, np.nan, 90.0],
        high_omega=[40.0, 41.0, 157.0],
        residual=np.full(3, 1e-15),
        felt_low=np.zeros(3),
        felt_high=[90.0, 80.0, 70.0],
        open_places=np.zeros(3, dtype=int),
        open_low=np.full(3, np.nan),
        open_high=np.full(3, np.nan),
    )


def bode_table(specs):
    length = 2 * len(specs)
    errors = {f"{name}_error": np.full(length, 1e-13) for name in ("admittance", "impedance", "worst_gain")}
    names = [spec.name for spec in specs for _ in range(2)]
    return rows_of("bode", length, spec=names, frequency_hz=np.tile([1.0, 10.0], len(specs)), **errors)


@pytest.fixture
def sweep(monkeypatch):
    """Replace the sweep, and give what it was called with."""
    import wavesweep.program.tables.specs  # noqa: F401 - which would keep what is replaced, if it were first imported then

    calls = Calls()

    def intervals(spec, **given):
        calls.note("intervals", **given)
        table = intervals_table()
        axes = {"B_VE": (0.5, 1.0)}
        forget = lambda: calls.forgotten.append(spec.name)  # noqa: E731 - one line among others
        return Table("zwidth", lambda: iter([table]), facts_of([spec]), axes, forget=forget)

    def responses(specs, **given):
        calls.note("responses", **given)
        return Table.of("bode", bode_table(specs), facts_of(specs))

    def plan(spec, **given):
        calls.note("plan", **given)
        return [f"kind {spec.values['controller.kind']}", "2 slices"]

    monkeypatch.setattr("wavesweep.program.tables.interval_table.intervals", intervals)
    monkeypatch.setattr("wavesweep.program.tables.response_table.responses", responses)
    if find_spec("wavesweep.check"):
        monkeypatch.setattr("wavesweep.check.planning.plan", plan)
    return calls


@pytest.fixture
def no_word_on_a_busy_machine(monkeypatch, request):
    """A command that takes long says so after ten seconds; the tests of messages are about that."""
    if request.path.name != "test_messages.py":
        monkeypatch.setattr("wavesweep.program.cli.messages.FIRST_WORD", 1e6)
        monkeypatch.setattr("wavesweep.program.cli.messages.MINUTE", 1e6)


@pytest.fixture
def a_word_on_the_time_after_one_sample(monkeypatch):
    """How long a run takes is measured in samples of it for a third of a second; the tests of jobs are about that."""
    monkeypatch.setattr(estimates.expected_seconds, "__defaults__", (0.0,))


@pytest.fixture
def spec(tmp_path, monkeypatch):
    """A spec file in the current folder, which is a new one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wall.toml").write_text(SPEC)
    return "wall.toml"


@pytest.fixture(name="wavesweep")
def command_line(capfdbinary, no_word_on_a_busy_machine, a_word_on_the_time_after_one_sample):
    """Run the command line and give (exit code, stdout, stderr)."""
    del no_word_on_a_busy_machine, a_word_on_the_time_after_one_sample

    def run(*arguments):
        code = main(arguments)
        streams = capfdbinary.readouterr()
        return code, streams.out.decode(), streams.err.decode()

    return run


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Write a spec into a new current folder; give its name."""
    monkeypatch.chdir(tmp_path)

    def write(text):
        (tmp_path / "a.toml").write_text(text, encoding="utf-8")
        return "a.toml"

    return write
