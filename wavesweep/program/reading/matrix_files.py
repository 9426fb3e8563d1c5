"""Matrices of state-space blocks from files of numpy and of MATLAB: a spec that names one has its
numbers from then on, so that results do not depend on the file later."""

import re
from collections.abc import Mapping
from io import BytesIO
from math import prod
from pathlib import Path as File
from typing import Any
from zipfile import ZipFile

from wavesweep.engine.drawing import keys_of_block
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key, Leaf, Mistakes, Path, computable, show
from wavesweep.program.reading.reading import PASSED, read_bytes

KIND = "ss"  # the type of block that has matrices
NAMES = ("A", "B", "C", "D")
NEEDED = NAMES[:3]  # without D there are no direct terms
MOST_BYTES = 2_000_000  # of a file, and of its arrays unpacked, as of a spec
MOST_NUMBERS = MOST_BYTES // 8  # doubles
# by the suffix of a file, what writes such a file
WRITTEN_BY = {
    ".npz": 'numpy.savez("plant.npz", A=A, B=B, C=C, D=D)',
    ".mat": 'save("plant.mat", "A", "B", "C", "D", "-v7")',
}
FILE = Key(
    "file",
    "string",
    None,
    "",
    "in place of A, B, C and D: an .npz file of numpy or a .mat file of MATLAB (up to version 7) "
    "with these arrays, relative to the spec's folder",
)


class _Unfit(ValueError):
    """A file without usable matrices: what was expected and what was found."""


def keys_of(kind: str) -> dict[str, Key]:
    """Return the keys that a spec may give a block of this type: those of the engine and files."""
    keys = keys_of_block(kind)
    if kind == KIND:
        return {**keys, FILE.path: FILE}
    return keys


def with_matrices(
    leaves: Mapping[Path, Leaf], source: str | None, mistakes: Mistakes
) -> dict[Path, Leaf]:
    """Return the leaves with the matrices in place of the file that a block of type "ss" names,
    also one of a class; add the mistakes.

    source: path of the spec, None for a dict. Paths are relative to its folder, and to the current
    one if it has none.
    """
    has_folder = source is not None and not re.fullmatch(PASSED, source)
    folder = File(source).parent if has_folder else File()
    read = dict(leaves)
    for path, leaf in leaves.items():
        if not _is_file_of_matrices(path, leaves):
            continue
        del read[path]
        name = ".".join(path)
        beside = [matrix for matrix in NAMES if (*path[:-1], matrix) in leaves]
        if beside:
            mistakes.refuse(leaf, name, f"either file or {', '.join(NAMES)}", f"{beside[0]} too")
            for matrix in beside:
                del read[(*path[:-1], matrix)]
            continue
        for matrix, rows in _matrices(leaf, name, folder, mistakes).items():
            read[(*path[:-1], matrix)] = Leaf(rows, leaf.place)
    return read


def _is_file_of_matrices(path: Path, leaves: Mapping[Path, Leaf]) -> bool:
    """Whether a path is that of the file of a block of type "ss"."""
    kind = leaves.get((*path[:-1], "type"))
    is_block = path[-3:-2] == ("block",) and path[0] in ("block", "type")
    return is_block and path[-1] == FILE.path and kind is not None and kind.value == KIND


def _matrices(
    leaf: Leaf, name: str, folder: File, mistakes: Mistakes
) -> dict[str, list[list[float]]]:
    """The matrices in the file that a key names; adds its mistakes. folder: that of the spec."""
    text = mistakes.check(FILE, leaf, name)
    if text is None:
        return {}
    try:
        return read_matrices(str(folder / text))
    except UsageError as error:
        mistakes.refuse(leaf, name, "a file that can be read", str(error), of_key=False)
    except _Unfit as error:
        mistakes.refuse(leaf, name, *error.args, of_key=False)
    return {}


def read_matrices(path: str) -> dict[str, list[list[float]]]:
    """Return the rows of each matrix in a file that is not empty, by name.

    Errors: UsageError if it cannot be read, _Unfit if it has no usable matrices.
    """
    suffix = File(path).suffix.lower()
    if suffix not in WRITTEN_BY:
        raise _Unfit("a file .npz or .mat", show(path))
    content = read_bytes(path, MOST_BYTES)
    try:
        arrays = _of_numpy(content) if suffix == ".npz" else _of_matlab(content)
    except _Unfit:
        raise
    except Exception as error:  # any: damaged archives fail in many ways
        reason = " ".join(str(error).split())
        expected = f"arrays of numbers as {WRITTEN_BY[suffix]} writes them"
        raise _Unfit(expected, f"{path}: {reason or type(error).__name__}") from error
    for name in NEEDED:
        if name not in arrays:
            expected = f"arrays {', '.join(NEEDED)} and, unless zero, D"
            raise _Unfit(expected, f"{path} without {name}")
    matrices = {}
    for name, array in arrays.items():
        numbers = _numbers(name, array, path)
        if numbers.size:  # one without entries is none in a spec
            matrices[name] = numbers.tolist()
    return matrices


def _numbers(name: str, array: Any, path: str) -> Any:
    """An array of a file as an array of numbers that can be computed with. Errors: _Unfit."""
    expected = f"{name} to be an array of real numbers of two dimensions"
    dimensions = getattr(array, "ndim", "none")
    if dimensions != 2:
        raise _Unfit(expected, f"{path}: {dimensions} of them")
    if array.dtype.kind not in "iuf" or array.dtype.itemsize > 8:
        raise _Unfit(expected, f"{path}: entries of type {array.dtype}")
    numbers = array.astype(float)
    wrong = numbers[~computable(numbers)]
    if wrong.size:
        expected = f"{name} of finite numbers, each 0 or of a size to compute with"
        raise _Unfit(expected, f"{path}: {wrong[0]:g}")
    return numbers


def _of_numpy(content: bytes) -> dict:
    """The matrices in an archive of numpy. Pickled objects are refused, as they may run anything."""
    import numpy as np

    members = {f"{name}.npy" for name in NAMES}
    with ZipFile(BytesIO(content)) as archive:
        unpacked = sum(
            member.file_size for member in archive.infolist() if member.filename in members
        )
    if unpacked > MOST_BYTES:
        raise _Unfit(f"arrays of at most {MOST_BYTES / 1e6:g} MB", f"{unpacked / 1e6:.3g} MB")
    with np.load(BytesIO(content), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in NAMES if name in arrays.files}


def _of_matlab(content: bytes) -> dict:
    """The matrices in a file of MATLAB."""
    from scipy.io import loadmat, whosmat
    from scipy.sparse import issparse

    count = sum(prod(shape) for name, shape, _ in whosmat(BytesIO(content)) if name in NAMES)
    if count > MOST_NUMBERS:
        raise _Unfit(f"matrices of at most {MOST_NUMBERS} numbers", f"{count}")
    arrays = {}
    for name, array in loadmat(BytesIO(content), variable_names=NAMES).items():
        if name in NAMES:
            arrays[name] = array.toarray() if issparse(array) else array
    return arrays
