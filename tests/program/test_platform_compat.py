"""A system without POSIX locks, signals, affinity and the like gives the same bytes."""

import multiprocessing
import subprocess
import sys
import tempfile

import pytest

from wavesweep.program.platform_compat import why_no_processes

SPEC = """
[controller]
kind = "pmw"
[environment]
integration = "explicit"
[sweep]
K_VE = { start = 0, stop = 20000 }
b = { start = 5, stop = 100, num = 12 }
B_VE = { start = 0, stop = 15, num = 9 }
"""
WITHOUT = """
import errno, os, signal, sys
import pyarrow.parquet, scipy.linalg  # which may look for them

for name in ("fcntl", "resource", "_multiprocessing"):
    sys.modules[name] = None
for name in ("sched_getaffinity", "uname", "pread", "pwrite", "fork", "getuid", "mkfifo"):
    delattr(os, name)
for name in [name for name in dir(os) if name in ("O_NOFOLLOW", "O_CLOEXEC", "O_NONBLOCK", "O_DIRECTORY")]:
    delattr(os, name)
for name in ("SIGHUP", "SIGKILL", "pthread_sigmask"):
    delattr(signal, name)
opened = os.open

def no_folders(path, *rest, **named):
    if os.path.isdir(path):
        raise PermissionError(errno.EACCES, "Permission denied", path)
    return opened(path, *rest, **named)

renamed = os.rename

def not_over_another(path, target, **named):
    if os.path.lexists(target):
        raise FileExistsError(errno.EEXIST, "File exists", path)
    return renamed(path, target, **named)

os.open, os.rename = no_folders, not_over_another
from wavesweep.program.cli import main
sys.exit(main())
"""
FILES = ["zwidth.csv", "zwidth.datapackage.json", "zwidth.parquet"]


@pytest.mark.slow
def test_a_system_without_what_only_posix_has_gives_the_same_bytes(tmp_path):
    (tmp_path / "wall.toml").write_text(SPEC)
    words = ["zwidth", "wall.toml", "--no-plot", "--out"]
    usual = subprocess.run([sys.executable, "-m", "wavesweep", *words, "usual"], cwd=tmp_path, capture_output=True, check=False)
    other = subprocess.run(
        [sys.executable, "-c", WITHOUT, *words, "other"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (usual.returncode, other.returncode) == (0, 0), other.stderr
    for folder in ("usual", "other"):
        assert sorted(path.name for path in (tmp_path / folder).iterdir() if not path.name.startswith(".zwidth.")) == FILES
    for name in ("zwidth.csv", "zwidth.parquet"):
        assert (tmp_path / "usual" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


@pytest.mark.parametrize("place", ["/größe", "/größe/x"])
def test_no_process_is_started_where_its_folder_has_letters_that_loky_does_not_take(place, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", place)
    assert "TMPDIR, /größe" in why_no_processes()


def test_no_process_is_started_without_semaphores(monkeypatch):
    def read_only():
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(multiprocessing.get_context("fork"), "Lock", read_only, raising=False)
    assert "Read-only file system" in why_no_processes()
