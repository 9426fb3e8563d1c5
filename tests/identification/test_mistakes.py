"""Files that cannot be used: each has one message, which says where, what was expected and what was found."""

from pathlib import Path

import numpy as np
import pytest
from support.expected import assert_expected

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.identification.points import MOST_POINTS, response_of, walls_of

GOOD = ["time,force,position", *(f"{k / 1000},{np.sin(k / 9):.5f},{1e-3 * np.sin(k / 9):.6f}" for k in range(60))]
HEAD = GOOD[0]


def with_row(text):
    """The good log with another row 31."""
    return [*GOOD[:30], text, *GOOD[31:]]


LOGS = {
    "a stamp of a clock that runs back": [HEAD, *(f"{1.7e9 + (k if k != 30 else 9) / 1000:.6f},{k},{k}" for k in range(60))],
    "a preamble, a blank line and no number": ["device,arm", "", HEAD, *GOOD[1:12], "", *GOOD[12:20], "0.02,x,0"],
    "a name that a shell takes apart": [HEAD.replace("position", "the position (x)"), *GOOD[1:]],
    "decimal commas": [HEAD, *(line.replace(".", ",") for line in GOOD[1:])],
    "commas within numbers": [HEAD, *(f"{k},{k},1,0,5" for k in range(60))],
    "no header": GOOD[1:],
    "few rows": GOOD[:20],
    "no rows": GOOD[:1],
    "nothing": [],
    "no text": ["\0\1\2\3" * 100],
    "a column missing": [line.rpartition(",")[0] for line in GOOD],
    "a column misspelt": [HEAD.replace("position", "positon"), *GOOD[1:]],
    "a column with the name of a unit": [HEAD.replace("force,position", "torque,rpm"), *GOOD[1:]],
    "a column twice": [f"{HEAD},force", *(f"{line},1" for line in GOOD[1:])],
    "time that runs back": with_row(GOOD[10]),
    "blank lines and a gap": ["", "", *GOOD[:30], *GOOD[33:]],
    "a gap": [*GOOD[:30], *GOOD[33:]],
    "time in nanoseconds": [HEAD, *(f"{k * 1e6},{k},{k * k}" for k in range(60))],
    "steps that grow": [HEAD, *(f"{(k / 1000) ** 1.3},{k},{k * k}" for k in range(200))],
    "no number": with_row("0.029,nan,0"),
    "an empty cell": with_row("0.029,,0"),
    "a number too long": with_row(f"0.029,{'1' * 400},0"),
    "a short row": with_row("0.029,1"),
    "a constant force": [HEAD, *(f"{k / 1000},1,{k}" for k in range(60))],
    "a current without a constant": [HEAD.replace("force", "current"), *GOOD[1:]],
    "a torque and a position": [HEAD.replace("force", "torque"), *GOOD[1:]],
    "a log of two axes": ["time,x,y,fx,fy", *GOOD[1:]],
    "a constant velocity": ["time,force,velocity", *(f"{k / 1000},{k},1" for k in range(60))],
    "positions beyond all measure": [HEAD, *(f"{k / 1000},{k % 7},{k % 5}e299" for k in range(60))],
    "a cell of 131,073 digits": with_row(f"0.029,{'1' * 131_073},0"),
    "a name of 131,073 letters": [HEAD + "," + "x" * 131_073, *(f"{line},1" for line in GOOD[1:])],
    "a constant position": [HEAD, *(f"{k / 1000},{k},0" for k in range(60))],
}
SIZES = "frequency_hz,admittance_abs,admittance_deg"
RESPONSES = {
    "a rate and friction": (SIZES, 60, {"friction": True}),
    "friction": (SIZES, 60, {"rate_hz": 1e3, "friction": True}),
    "few frequencies": (SIZES, 5, {"rate_hz": 1e3}),
    "other columns": ("frequency_hz,abs,deg", 60, {"rate_hz": 1e3}),
    "a column of none": (SIZES, 60, {"columns": {"frequency_hz": "w"}}),
    "a log with a rate": ("time,force,position", 60, {"rate_hz": 1e3}),
}
RESPONSE = f"{SIZES}\n1,0.002,-1\n2,0.003,-5\n"
POINTS = {
    "walls: a column missing": ("z_width", "B_VE,K\n1,2\n"),
    "walls: a column in small letters": ("z_width", "B_VE,k_ve\n1,2\n"),
    "walls: nothing": ("z_width", ""),
    "walls: no rows": ("z_width", "B_VE,K_VE\n"),
    "walls: no number": ("z_width", "B_VE,K_VE\n0,900\n1,nan\n"),
    "walls: an empty cell": ("z_width", "B_VE,K_VE\n0,900\n\n,950\n"),
    "walls: a negative stiffness": ("z_width", "B_VE,K_VE\n0,900\n1,-5\n"),
    "walls: a limit of 0": ("z_width", "B_VE,K_VE\n0,900\n1,0\n"),
    "walls: decimal commas": ("z_width", "B_VE,K_VE\n0,5,900,0\n"),
    "walls: yes": ("z_width", "B_VE,K_VE,stable\n0,900,yes\n"),
    "walls: too many": ("z_width", "B_VE,K_VE\n" + "1,2\n" * (MOST_POINTS + 1)),
    "walls: no text": ("z_width", b"B_VE,K_VE\n\0\xfe"),
    "walls: no file": ("z_width", None),
    "response: other columns": ("response", "nu,admittance_abs,admittance_deg\n1,1,1\n"),
    "response: a frequency twice": ("response", RESPONSE + "2,0.003,-5\n"),
    "response: an admittance of 0": ("response", RESPONSE + "3,0,-5\n"),
    "response: an infinite phase": ("response", RESPONSE.replace("-5", "inf")),
}


def test_every_file_that_cannot_be_used_has_one_message(tmp_path):
    path, said = tmp_path / "log.csv", []

    def refuse(case, call):
        with pytest.raises(UsageError) as caught:
            call()
        said.append(f"{case}: {caught.value}".replace(f"{tmp_path}/", ""))
        assert "\n" not in said[-1]

    for case, lines in LOGS.items():
        path.write_text("\n".join(lines))
        refuse(case, lambda: wavesweep.identify(path))
    for case, (header, rows, options) in RESPONSES.items():
        table = np.geomspace(0.5, 100, 60)[:rows, None].repeat(3, axis=1)
        np.savetxt(path, table, delimiter=",", header=header, comments="")
        refuse(f"response, {case}", lambda options=options: wavesweep.identify(path, **options))
    for case, (name, text) in POINTS.items():
        points = tmp_path / "points.csv"
        points.unlink(missing_ok=True)
        if text is not None:
            points.write_bytes(text if isinstance(text, bytes) else text.encode())
        (tmp_path / "mine.toml").write_text(f'[controller]\nkind = "dc"\n[measured]\n{name} = "points.csv"\n')
        spec = wavesweep.load(tmp_path / "mine.toml")
        refuse(case, lambda spec=spec, name=name: (walls_of if name == "z_width" else response_of)(spec))
    assert_expected(Path(__file__).parent / "mistakes.txt", "\n".join(said) + "\n")


@pytest.mark.parametrize("option", ["resolution", "delay"])
@pytest.mark.parametrize("size", [np.nan, np.inf, 1e-320, -1e300])
def test_an_option_of_no_usable_size_is_refused(option, size, tmp_path):
    (tmp_path / "log.csv").write_text("\n".join(GOOD))
    with pytest.raises(UsageError, match=rf"^--{option}: expected a number from 1e-30 to 1e\+30, or 0, found "):
        wavesweep.identify(tmp_path / "log.csv", **{option: size})


def test_noise_in_place_of_a_response_is_refused(tmp_path):
    rng = np.random.default_rng(1)
    rows = np.c_[1.0 + np.arange(100), np.abs(rng.standard_normal(100)), rng.uniform(-180, 180, 100)]
    np.savetxt(tmp_path / "noise.csv", rows, delimiter=",", header=SIZES, comments="")
    with pytest.raises(UsageError, match="that no numbers fit"):
        wavesweep.identify(tmp_path / "noise.csv")


@pytest.mark.parametrize(
    ("delay", "expected"), [(1100.0, "at most half of the rows, 500 ticks"), (-1000.0, "a number from 1e-30 to 1e\\+30, or 0")]
)
def test_a_delay_beyond_the_log_is_refused(delay, expected, tmp_path):
    path = tmp_path / "log.csv"
    rows = np.c_[np.arange(1000) / 1000, np.sin(np.arange(1000) / 9), np.sin(np.arange(1000) / 11)]
    np.savetxt(path, rows, delimiter=",", header="time,force,position", comments="")
    with pytest.raises(UsageError, match=rf"--delay: expected {expected}, found {delay:g}"):
        wavesweep.identify(path, delay=delay)
