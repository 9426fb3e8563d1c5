"""Matrices of a block in a file are those that the spec could have written; a file without usable ones is one mistake."""

import io
import pickle

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_matrix

import wavesweep
from wavesweep.engine.errors import SpecError
from wavesweep.program.reading import matrix_files
from wavesweep.program.spec import load

A, B, C, D = [[-3.0, 1.0], [0.25, -5.0]], [[1.0], [2.0]], [[1.0, -1.0]], [[0.125]]
SOUND = {"A": A, "B": B, "C": C, "D": D}
TEXT = """
[rates]
tick_hz = 100
[numbers]
k = 1.0
[block.plant]
type = "ss"
{}
[block.held]
type = "hold"
[wire]
"plant.u" = "held.y"
"held.u" = "k*plant.y"
[sweep]
along = "k"
k = {{ start = 0, stop = 6 }}
"""
FILE = 'file = "plant.{}"'
WRITTEN = "\n".join(f"{name} = {rows}" for name, rows in SOUND.items())


def npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def mat(**arrays):
    stream = io.BytesIO()
    savemat(stream, arrays)
    return stream.getvalue()


def spec_beside(folder, content, keys):
    """A spec with these keys of its plant, in the folder of a file of this content."""
    kind = "mat" if "plant.mat" in keys else "npz"
    if content is not None:
        (folder / f"plant.{kind}").write_bytes(content)
    path = folder / "spec.toml"
    path.write_text(TEXT.format(keys))
    return path


@pytest.mark.parametrize(
    ("kind", "content"),
    [
        ("npz", npz(**SOUND, unrelated=np.array("text"))),
        ("mat", mat(**SOUND, unrelated="text")),
        ("mat", mat(**SOUND | {name: csc_matrix(SOUND[name]) for name in "ABC"})),
        ("npz", npz(**SOUND | {"B": np.array([[1], [2]], dtype=">i2")})),
    ],
)
def test_matrices_of_a_file_are_those_of_a_spec_that_writes_them(tmp_path, kind, content):
    found = load(spec_beside(tmp_path, content, FILE.format(kind)))
    (tmp_path / f"plant.{kind}").unlink()
    written = load(spec_beside(tmp_path, None, WRITTEN))
    assert found.sha256 == written.sha256
    assert found.tables() == written.tables()
    ends = [wavesweep.compile(spec).stable_intervals()[["low", "high"]].to_numpy() for spec in (found, written)]
    np.testing.assert_array_equal(*ends)
    static = D[0][0] - (np.array(C) @ np.linalg.solve(A, B))[0, 0]
    np.testing.assert_allclose(ends[0][0], [0, 1 / static], rtol=1e-12)  # where it runs away


@pytest.mark.parametrize(
    ("content", "keys", "key", "said"),
    [
        (None, FILE.format("npz"), "file", "plant.npz: cannot be read: No such file"),
        (b"", 'file = "plant.csv"', "file", r"expected a file .npz or .mat"),
        (b"", "file = 3", "file", "expected a string, found 3"),
        (b"PK not an archive", FILE.format("npz"), "file", "plant.npz: File is not a zip file"),
        (npz(**SOUND)[:-30], FILE.format("npz"), "file", "numpy.savez"),
        (b"no file of MATLAB", FILE.format("mat"), "file", "save\\(.*-v7"),
        (b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM", FILE.format("mat"), "file", "plant.mat: .*HDF"),
        (npz(**SOUND | {"A": np.array([[{}]])}), FILE.format("npz"), "file", "Object arrays cannot"),
        (npz(A=A, C=C, K=B), FILE.format("npz"), "file", "plant.npz without B"),
        (npz(**SOUND | {"B": [1.0, 2.0]}), FILE.format("npz"), "file", "B to be an array .* found .*: 1 of them"),
        (npz(**SOUND | {"A": np.multiply(A, 1j)}), FILE.format("npz"), "file", "real .* of type complex128"),
        (mat(**SOUND | {"A": np.array([["x"]])}), FILE.format("mat"), "file", "A to be an array of real numbers"),
        (npz(**SOUND | {"C": [[1.0, np.nan]]}), FILE.format("npz"), "file", "C of finite numbers.* found .*: nan"),
        (npz(**SOUND | {"C": [[1.0, np.inf]]}), FILE.format("npz"), "file", "C of finite numbers.* found .*: inf"),
        (npz(**SOUND | {"B": [[1.0, 2.0]]}), FILE.format("npz"), "B", "a matrix of 2 x 1 numbers.* found 1 x 2"),
        (npz(**SOUND), FILE.format("npz") + "\nA = [[1]]", "file", "either file or A, B, C, D, found A too"),
    ],
)  # fmt: skip
def test_a_file_without_usable_matrices_is_one_mistake_with_its_place(tmp_path, content, keys, key, said):
    with pytest.raises(SpecError, match=said) as error:
        load(spec_beside(tmp_path, content, keys))
    (mistake,) = error.value.mistakes
    assert mistake.key == f"block.plant.{key}"
    assert mistake.location.startswith(f"{tmp_path / 'spec.toml'}:8:")


def test_a_pickle_in_a_file_is_not_run(tmp_path):
    class Armed:
        def __reduce__(self):
            return open, (str(tmp_path / "run"), "w")

    stream = io.BytesIO()
    np.savez(stream, **SOUND | {"A": np.array([[Armed()]], dtype=object)}, allow_pickle=True)
    assert b"run" in pickle.dumps(Armed())
    with pytest.raises(SpecError, match="Object arrays cannot be loaded"):
        load(spec_beside(tmp_path, stream.getvalue(), FILE.format("npz")))
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("kind", ["npz", "mat"])
def test_a_file_that_unpacks_to_too_much_is_refused_before_it_is(tmp_path, kind, monkeypatch):
    stream = io.BytesIO()
    large = SOUND | {"A": np.zeros((600, 600))}
    if kind == "npz":
        np.savez_compressed(stream, **large)
        monkeypatch.setattr(np, "load", None)
    else:
        savemat(stream, large, do_compression=True)
        monkeypatch.setattr("scipy.io.loadmat", None)
    assert len(stream.getvalue()) < matrix_files.MOST_BYTES
    with pytest.raises(SpecError, match="at most 2"):
        load(spec_beside(tmp_path, stream.getvalue(), FILE.format(kind)))
