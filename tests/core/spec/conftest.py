"""What the tests of specs share."""

import pytest


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Write a spec into a new current folder; give its name."""
    monkeypatch.chdir(tmp_path)

    def write(text):
        (tmp_path / "a.toml").write_text(text, encoding="utf-8")
        return "a.toml"

    return write
