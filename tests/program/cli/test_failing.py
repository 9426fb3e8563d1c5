"""Each kind of failing has its exit code and a line for its user; a traceback comes with --debug only."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.program import results
from wavesweep.program.cli import main


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (IllPosedLoopError("the loop has no solution"), 1, "Error: the loop has no solution"),
        (UsageError("no such axis"), 2, "Error: no such axis"),
        (KeyboardInterrupt(), 130, "Interrupted."),
        (MemoryError(), 1, "Error: out of memory"),
        (ImportError("libarrow.so: failed to map segment from shared object"), 1, "Error: out of memory"),
        (OSError(28, "No space left on device"), 1, "Error: No space left on device"),
        (PermissionError(13, "Permission denied", "there/x.csv"), 1, "Error: there/x.csv: Permission denied"),
        (
            ZeroDivisionError("by zero"),
            1,
            "Error: ZeroDivisionError: by zero (a fault of wavesweep; --debug shows where)",
        ),
    ],
)
def test_a_failing_run_says_one_line_and_its_code(error, code, line, wavesweep, sweep, spec, tmp_path):
    sweep.fail = error
    found, out, err = wavesweep("zwidth", spec)
    assert (found, out, err.strip()) == (code, "", line)
    assert not (tmp_path / "results").exists()
    found, _, err = wavesweep("zwidth", spec, "--debug")
    assert found == code
    assert "Traceback" in err
    assert err.strip().endswith(line)


@pytest.mark.whole
@pytest.mark.parametrize("error", [UsageError("no"), ValueError("a fault"), KeyboardInterrupt(), OSError(28, "full")])
@pytest.mark.parametrize("command", ["zwidth", "design"])
def test_a_run_that_fails_before_anything_is_finished_leaves_nothing(command, error, wavesweep, tmp_path, monkeypatch):
    def fail(*_):
        raise error

    for module in ("wavesweep.program.sweep.running", "wavesweep.designs.study"):
        monkeypatch.setattr(f"{module}.choose", fail)
    monkeypatch.chdir(tmp_path)
    sweep = "[sweep]\nB_VE = { start = 0, stop = 10, num = 300 }\n"
    study = '[design]\nvary = { "device.damping" = { start = 1, stop = 3 } }\nwish = { z_width = {} }\n'
    Path("mine.toml").write_text('controller.kind = "dc-slow"\n' + sweep + study)
    assert wavesweep(command, "mine.toml", "--quiet")[0] in (1, 2, 130)
    assert not list(tmp_path.glob("results/**/.*"))


def run_as_program(before, cwd, *words):
    """Exit code, stdout and stderr of the command line in a process of its own, which runs `before` first."""
    program = f"import atexit, os, signal, sys\n{before}\nsys.argv = ['wavesweep', *{words!r}]\n"
    program += "from wavesweep.program.cli import main\nsys.exit(main())"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=cwd, check=False)
    return done.returncode, done.stdout, done.stderr


def test_an_interrupt_while_the_program_is_loaded_is_one_line(tmp_path):
    (tmp_path / "click.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    assert run_as_program("", tmp_path, "keys") == (130, "", "Interrupted.\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_python_shuts_down_ends_it_without_a_word(number, tmp_path):
    late = f"atexit.register(lambda: os.kill(os.getpid(), {int(number)}))"
    code, out, err = run_as_program(late, tmp_path, "--version")
    assert (code, out.startswith("wavesweep "), err) == (-number, True, "")


def test_results_of_another_spec_are_refused_before_the_work(wavesweep, sweep, spec, tmp_path):
    (tmp_path / "other.toml").write_text((tmp_path / spec).read_text() + "[device]\nmass = 0.2\n")
    wavesweep("zwidth", spec, "--no-plot", "--out", "here")
    for several in (["zwidth", "other.toml"], ["zwidth", "other.toml", "--json"]):
        code, _, err = wavesweep(*several, "--no-plot", "--out", "here")
        assert code == 2
        assert "found results of another spec" in err
        assert "--overwrite" in err
    assert len(sweep.seen) == 1
    code, _, err = wavesweep("zwidth", "other.toml", "--no-plot", "--out", "here", "--overwrite")
    assert code == 0
    assert "replaced" not in err


@pytest.mark.slow
def test_a_reader_that_leaves_early_is_no_error_to_talk_about(spec, tmp_path):
    program = (
        "import sys, os, signal\n"
        "from wavesweep.program.cli import main\n"
        "from wavesweep import results\n"
        "from wavesweep.program.tables import interval_table as intervals, table\n"
        "def stream(table, out):\n"
        "    for _ in range(100000): out.write(b'0123456789' * 10)\n"
        "results.stream = stream\n"
        "intervals.intervals = lambda *_, **__: table.Table('zwidth', list, {}, {})\n"
        f"sys.exit(main(['zwidth', {spec!r}, '--out', '-', '--quiet']))\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.read(10)
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == 1
    assert list(tmp_path.iterdir()) == [tmp_path / spec]


def test_a_second_run_in_a_folder_is_refused_before_the_work_and_another_command_is_not(wavesweep, sweep, spec):
    with results.at_work(["zwidth"], "here"):
        code, _, err = wavesweep("zwidth", spec, "--no-plot", "--out", "here", "--overwrite")
        assert code == 1
        assert err.startswith(f"Error: here: another run is at work on zwidth here (process {os.getpid()} on ")
        assert err.endswith("; give --wait to wait for it, or another --out\n")
        assert sweep.seen == []
        assert wavesweep("bode", spec, "--no-plot", "--out", "here")[0] == 0
    assert wavesweep("zwidth", spec, "--no-plot", "--out", "here", "--wait")[0] == 0


@pytest.mark.slow
@pytest.mark.whole
def test_a_full_disk_leaves_no_part_of_the_files(wavesweep, spec, tmp_path, monkeypatch):
    """Full at the fourth new file: the folder is gone again, with the three files before it."""
    make, made = os.open, []  # made: the new files, in folders beside their places

    def full(path, *rest, **more):
        temporary = ".wavesweep.new-" in str(path) and bool(rest[0] & os.O_CREAT)
        made.extend([path] if temporary else [])
        if temporary and len(made) == 4:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return make(path, *rest, **more)

    monkeypatch.setattr(os, "open", full)
    code, _, err = wavesweep("export", spec, "--to", "c", "--out", "there")
    assert code == 1
    assert err.startswith("Error: there/")
    assert "No space left on device" in err
    assert len(made) == 4
    assert not (tmp_path / "there").exists()


def test_a_disk_that_is_full_at_the_end_keeps_the_work(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    spec = '[controller]\nkind = "pmw"\n[sweep]\nK_VE = { start = 0, stop = 2000 }\n'
    spec += "B_VE = { start = 0, stop = 15, num = 9000 }\n"
    (tmp_path / "wall.toml").write_text(spec)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    words = ["zwidth", "wall.toml", "--no-plot", "--out", "there"]
    with monkeypatch.context() as patched:
        patched.setattr("wavesweep.program.results.table_writing.package_text", full)
        assert main(words) == 1
    said = capsys.readouterr().err
    (kept,) = (tmp_path / "there").glob(".zwidth-*.sqlite")
    assert "Error: there: No space left on device" in said.splitlines()[-1]  # after what is said of a slow run
    assert f"is kept in there/{kept.name}; the same command goes on from there." in said
    assert main(words) == 0
    assert sorted(path.name for path in (tmp_path / "there").iterdir()) == [
        "zwidth.csv",
        "zwidth.datapackage.json",
        "zwidth.parquet",
    ]


@pytest.mark.parametrize("resources", ["null", "3", '"x"', "[]", "{}", "[1]", '[{"schema": null}]', '[{"schema": []}]'])
def test_a_figure_of_a_table_with_a_damaged_package_is_refused_in_a_line(resources, wavesweep, spec, tmp_path):
    wavesweep("zwidth", spec, "--no-plot", "--out", "here", "--set", "sweep.B_VE=[1]")
    package = tmp_path / "here" / "zwidth.datapackage.json"
    facts = json.loads(package.read_text()) | {"resources": json.loads(resources)}
    package.write_text(json.dumps(facts))
    code, out, err = wavesweep("plot", "here/zwidth.csv")
    assert (code, out) == (2, "")
    assert err.startswith("Error: here/zwidth")
    assert "fault of wavesweep" not in err


@pytest.mark.usefixtures("sweep")
def test_control_characters_of_foreign_files_are_shown_and_not_sent(wavesweep, spec, tmp_path):
    wavesweep("zwidth", spec, "--no-plot", "--quiet")
    package = tmp_path / "results/wall/zwidth.datapackage.json"
    package.write_text(package.read_text().replace('"spec_sha256": "', '"spec_sha256": "\\u001b[31m'))
    code, out, err = wavesweep("verify", "results/wall")
    assert (code, "\x1b" in out + err) == (1, False)


REPLACING = [
    (["zwidth", "READ", "--out", "MADE"], "mine.csv"),
    (["zwidth", "READ", "--out", "."], "zwidth.csv"),
    (["bode", "READ", "--out", "MADE"], "mine.svg"),
    (["zwidth", "wall.toml", "READ", "--out", "."], "zwidth-specs.png"),
    (["simulate", "READ", "--out", "."], "simulate.datapackage.json"),
    (["design", "READ", "--out", "."], "best/mine-01.toml"),
    (["zwidth", "wall.toml", "--set", "measured.z_width=READ", "--out", "."], "zwidth.csv"),
    (["report", "READ", "--out", "MADE"], "mine.html"),
    (["export", "READ", "--to", "c", "--out", "."], "controller.h"),
    (["check", "READ", "--plot", "--out", "MADE"], "mine.png"),
    (["identify", "READ", "--out", "MADE"], "mine.csv"),
    (["identify", "READ"], "results/identify/identify.csv"),
    (["identify", "/dev/stdin", "--out", "MADE"], "mine.csv"),
]


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize(("words", "name"), REPLACING)
@pytest.mark.parametrize("linked", [False, True])
def test_no_command_replaces_a_file_that_it_reads(wavesweep, spec, words, name, linked):
    """The link is to the file in the place of the results."""
    text = Path(spec).read_text() + "[design]\nvary.b = [20, 30]\nwish.z_width = {}\n"
    if words[0] == "identify":
        text = "time,force,position\n" + "".join(f"{0.001 * n},{n % 7},{n % 5}\n" for n in range(60))
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text)
    given = name
    if linked:
        Path("link").mkdir()
        given = f"link/{Path(name).name}"
        Path(given).symlink_to(Path(name).absolute())
    before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
    words = [word.replace("READ", given).replace("MADE", name) for word in words]
    with Path(name).open("rb") as own:
        saved = os.dup(0)
        os.dup2(own.fileno(), 0)
        try:
            code, out, err = wavesweep(*words, "--overwrite" if words[0] != "check" else "--all")
        finally:
            os.dup2(saved, 0)
            os.close(saved)
    assert (code, out) == (2, "")
    assert "which is read" in err
    assert {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()} == before


def test_a_process_with_too_little_memory_is_told_before_a_library_crashes(wavesweep, spec, monkeypatch):
    monkeypatch.setattr("wavesweep.program.cli.entry.memory_limit", lambda: 205e6)
    code, out, err = wavesweep("zwidth", spec, "--no-plot")
    assert (code, out) == (1, "")
    assert err.startswith("Error: this process may take 205 MB of memory (ulimit -v), with which libraries crash or hang; ")
