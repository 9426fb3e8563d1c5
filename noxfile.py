"""What a forge runs, by hand: `nox --list`, `nox -s lint`, `nox -s least`. It stands here because nox looks for it here.

Python versions that are not on this machine are skipped.
"""

import re

import nox

PROJECT = nox.project.load_toml("pyproject.toml")["project"]
PYTHONS = [each.rpartition(" ")[2] for each in PROJECT["classifiers"] if re.fullmatch(r".* :: 3\.\d+", each)]
TESTS = ("python", "-m", "pytest", "-q", "-n", "2", "--dist", "worksteal")
nox.options.default_venv_backend = "venv"
nox.options.sessions = ["lint", "ci"]


@nox.session
def lint(session: nox.Session) -> None:
    """The linter, the format, and the types of the library."""
    session.install("-c", "constraints.txt", "ruff", "mypy", "pandas-stubs")
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("mypy")


@nox.session(python=PYTHONS)
def ci(session: nox.Session) -> None:
    """All of `.ci/run`, of the last commit."""
    session.run(".ci/run", external=True)


@nox.session(python=PYTHONS[0])
def least(session: nox.Session) -> None:
    """The tests with the least version of everything that pyproject.toml allows."""
    needed = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]]
    session.install("--only-binary", ":all:", *(each.replace(">=", "==") for each in needed))
    session.install("--no-deps", "-e", ".")
    session.run("python", "-m", "pytest", "-q", *session.posargs)


@nox.session(python=PYTHONS[-1])
def newest(session: nox.Session) -> None:
    """The tests with the newest version of everything."""
    session.install(".[test]")
    session.run(*TESTS, *session.posargs)


@nox.session(venv_backend="none")
def checker(session: nox.Session) -> None:
    """The checker of proofs in dist/: as one file, and as a wheel."""
    session.run("python3", ".ci/checker.py", "dist/wavesweep-checker.pyz", external=True)
    session.run("python3", "-m", "pip", "wheel", "--no-deps", "--wheel-dir", "dist", "./wavesweep/checker", external=True)
