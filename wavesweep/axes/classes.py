"""The classes of blocks that a spec may use without drawing them: each a file beside this one,
its own `[type.NAME]`."""

from pathlib import Path

CLASSES = {path.stem: path for path in sorted(Path(__file__).parent.glob("*.toml"))}
