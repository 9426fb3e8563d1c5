"""How much there is, beside the last release: what has grown by more than 1 % says in docs/design-notes.md what it pays for.

With --release the sizes are kept in size.json as those of a release, and the lines of the notes go. With --rooms it prints
what each folder weighs: nodes, names that it has through the public modules of the engine, and names without a meaning.
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
VAGUE = {"at", "found", "each", "left", "own", "known", "along", "most", "other", "others", "given", "asked"}
VAGUE |= {"held", "kept", "one", "what"}  # names that say where a word stands in a sentence
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


def count_nodes(tree: ast.AST) -> int:
    """The nodes of a tree, without the marks of reading and writing."""
    return sum(not isinstance(node, ast.Load | ast.Store) for node in ast.walk(tree))


def vague_names(tree: ast.AST) -> int:
    """How often a variable or a parameter has a name that says where it stands in a sentence, and not what it is."""
    assigned = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    parameters = [node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)]
    return sum(name in VAGUE for name in assigned + parameters)


def names_through(tree: ast.AST) -> int:
    """The names that a file imports from the public modules of the engine."""
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    public = [node for node in imports if (node.module or "").startswith("wavesweep.engine") and "._" not in node.module]
    return sum(len(node.names) for node in public)


def print_rooms() -> None:
    """What each folder of the package weighs, the heaviest first."""
    rooms = {
        path.name: f"wavesweep/{path.name}/*.py" for path in (ROOT / "wavesweep").iterdir() if (path / "__init__.py").is_file()
    }
    trees = {room: [ast.parse(text) for text in texts(pattern)] for room, pattern in rooms.items()}
    print(f"{'folder':16}{'nodes':>8}{'names of the engine':>21}{'vague names':>13}")
    for room, files in sorted(trees.items(), key=lambda item: -sum(map(count_nodes, item[1]))):
        print(f"{room:16}{sum(map(count_nodes, files)):8}{sum(map(names_through, files)):21}{sum(map(vague_names, files)):13}")


def sizes() -> dict[str, int]:
    """Nodes of the syntax of the package, numeric constants of its modules, lines of tests, and words of all pages."""
    trees = [ast.parse(text) for text in texts("wavesweep/*.py")]
    return {
        "nodes": sum(map(count_nodes, trees)),
        "constants": sum(is_number(node) for tree in trees for node in tree.body),
        "test lines": sum(len(text.splitlines()) for text in texts("tests/*.py")),
        "words": sum(len(text.split()) for text in texts("*.md")),
        "vague names": sum(map(vague_names, trees)),
    }


def main() -> int:
    """Print the sizes, or keep them as those of a release; 1 if one has grown without a line of the notes."""
    if "--rooms" in sys.argv:
        print_rooms()
        return 0
    now = sizes()
    notes = NOTES.read_text(encoding="utf-8").splitlines(keepends=True)
    if "--release" in sys.argv:
        RELEASED.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
        paid = tuple(f"- {name}: " for name in now)
        NOTES.write_text("".join(line for line in notes if not line.startswith(paid)), encoding="utf-8")
        return 0
    unpaid = False
    released = json.loads(RELEASED.read_text(encoding="utf-8"))
    for name in now.keys() - released.keys():
        print(f"{name}: {now[name]}")
    for name, before in released.items():
        paid = now[name] <= GROWTH * before or any(line.startswith(f"- {name}: ") for line in notes)
        unpaid |= not paid
        print(f"{name}: {now[name]}, {before} in the last release", "" if paid else "- has grown, and nothing says for what")
    return int(unpaid)


if __name__ == "__main__":
    sys.exit(main())
