"""How much there is, beside the last release: what has grown by more than 1 % says in docs/design-notes.md what it pays for.

With --release the sizes are kept in size.json as those of a release, and the lines of the notes go.
"""

import ast
import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RELEASED = Path(__file__).with_suffix(".json")
NOTES = ROOT / "docs/design-notes.md"
GROWTH = 1.01  # of a number, beyond which a line of the notes has to begin with its name
PLAIN = (ast.Constant, ast.UnaryOp, ast.BinOp, ast.unaryop, ast.operator, ast.Tuple, ast.Load)


def texts(*patterns: str) -> list[str]:
    """The files of the repository that match."""
    listed = subprocess.run(["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True).stdout  # noqa: S607
    return [path.read_text(encoding="utf-8") for path in map(ROOT.joinpath, listed.splitlines()) if path.is_file()]


def is_number(node: ast.AST) -> bool:
    """Whether it gives a name a plain number, or several."""
    parts = [*ast.walk(node.value)] if isinstance(node, ast.Assign | ast.AnnAssign) and node.value else []
    types = [type(part.value) for part in parts if isinstance(part, ast.Constant)]
    return (int in types or float in types) and all(isinstance(part, PLAIN) for part in parts)


def sizes() -> dict[str, int]:
    """Nodes of the syntax of the package, numeric constants of its modules, lines of tests, and words of all pages."""
    trees = [ast.parse(text) for text in texts("wavesweep/*.py")]
    return {
        "nodes": sum(not isinstance(node, ast.Load | ast.Store) for tree in trees for node in ast.walk(tree)),
        "constants": sum(is_number(node) for tree in trees for node in tree.body),
        "test lines": sum(len(text.splitlines()) for text in texts("tests/*.py")),
        "words": sum(len(text.split()) for text in texts("*.md")),
    }


def main() -> int:
    """Print the sizes, or keep them as those of a release; 1 if one has grown without a line of the notes."""
    now = sizes()
    notes = NOTES.read_text(encoding="utf-8").splitlines(keepends=True)
    if "--release" in sys.argv:
        RELEASED.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
        paid = tuple(f"- {name}: " for name in now)
        NOTES.write_text("".join(line for line in notes if not line.startswith(paid)), encoding="utf-8")
        return 0
    unpaid = False
    for name, before in json.loads(RELEASED.read_text(encoding="utf-8")).items():
        paid = now[name] <= GROWTH * before or any(line.startswith(f"- {name}: ") for line in notes)
        unpaid |= not paid
        print(f"{name}: {now[name]}, {before} in the last release", "" if paid else "- has grown, and nothing says for what")
    return int(unpaid)


if __name__ == "__main__":
    sys.exit(main())
