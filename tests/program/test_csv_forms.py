"""Files as other programs write them, of which the same columns are read."""

import json

import numpy as np
import pytest

from wavesweep.program.csv_files import option, read_csv, seconds

ROWS = [(k / 1000, 1.5 * k, -0.25 * k) for k in range(12)]
PLAIN = "\n".join(["t,F,x", *(f"{t},{force},{place}" for t, force, place in ROWS)])
FORMS = {
    "commas": PLAIN,
    "a byte order mark": "\ufeff" + PLAIN,
    "carriage returns": PLAIN.replace("\n", "\r\n"),
    "semicolons": PLAIN.replace(",", ";"),
    "tabs": PLAIN.replace(",", "\t"),
    "spaces": PLAIN.replace(",", "   "),
    "spaces at the start": "\n".join("  " + line for line in PLAIN.replace(",", "   ").split("\n")),
    "semicolons and decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "tabs and decimal commas": PLAIN.replace(",", "\t").replace(".", ","),
    "a preamble": "Recorder 3\nrate,1000 Hz\n\nchannels,3,of,the arm\n" + PLAIN,
    "a preamble as wide as the rows": "os,cpu,gpu\nLinux,some,other\n" + PLAIN,
    "a preamble of numbers": "3,2,1\n" + PLAIN,
    "JSON of columns": json.dumps(
        {"Info": {"app": "x"}, "Runs": [{"Data": dict(zip("tFx", zip(*ROWS, strict=True), strict=True))}]}
    ),
    "JSON of rows": json.dumps({"frames": [dict(zip("tFx", row, strict=True)) | {"name": "arm"} for row in ROWS]}),
    "JSON of a row a line": "\n".join(json.dumps(dict(zip("tFx", row, strict=True))) for row in ROWS),
    "JSON with a list of a sensor": json.dumps(
        {"a": dict(zip("tFx", zip(*ROWS, strict=True), strict=True)), "b": {"Values": [0, 1]}}
    ),
    "a mark of comments": "# arm 3\n# " + PLAIN,
    "a mark of comments, spaces": "# " + PLAIN.replace(",", " "),
    "framestats": f"Uptime: 5 Realtime: 5\n\n---PROFILEDATA---\n{PLAIN}\n---PROFILEDATA---\n\nView hierarchy:\n  x, 3 views",
}


@pytest.mark.parametrize("form", FORMS)
def test_columns_are_read_in_each_form(form, tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(FORMS[form].encode())
    assert read_csv(path, 10**6).numbers(["t", "F", "x"]) == pytest.approx(np.array(ROWS))


@pytest.mark.parametrize("code", ["utf-16", "cp1252"])
def test_units_below_the_names_are_behind_them_in_any_code(code, tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(PLAIN.replace("t,F,x", "t,F,x\n[µs],mN,°").encode(code))
    file = read_csv(path, 10**6)
    assert file.names == ["t (µs)", "F (mN)", "x (°)"]
    assert file.numbers(file.names) == pytest.approx(np.array(ROWS))
    assert path.read_text(code).split("\n")[file.line(3) - 1] == PLAIN.split("\n")[4]


def test_a_row_is_told_by_its_line_in_the_file(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("arm 3\n\n" + PLAIN.replace("\n0.005", "\n\n0.005"))
    file = read_csv(path, 10**6)
    lines = path.read_text().split("\n")
    assert [lines[file.line(row) - 1] for row in (0, 5, 11)] == [PLAIN.split("\n")[row + 1] for row in (0, 5, 11)]


def test_advice_is_one_word_of_a_shell_and_a_stamp_has_the_digits_of_its_row():
    assert option("time", "Time (ms)") == "--column 'time=Time (ms)'"
    assert option("time", "stamp") == "--column time=stamp"
    assert (seconds(0.0123), seconds(1.7e9 + 0.001)) == ("0.0123", "1700000000.001000")
