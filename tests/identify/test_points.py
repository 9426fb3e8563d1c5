"""Files of measured points: what is read, and one message for each that cannot be used."""

import numpy as np
import pytest

import wavesweep
from wavesweep.errors import SpecError, UsageError
from wavesweep.identification.points import MOST_POINTS, response_of, walls_of

RESPONSE = "frequency_hz,admittance_abs,admittance_deg\n1,0.002,-1\n2,0.003,-5\n"


def spec_of(tmp_path, name, text):
    if text is not None:
        (tmp_path / "points.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    path = tmp_path / "mine.toml"
    path.write_text(f'[controller]\nkind = "dc"\n[measured]\n{name} = "points.csv"\n')
    return wavesweep.load(path)


def test_walls_and_responses_are_read_from_the_folder_of_the_spec(tmp_path):
    walls = walls_of(spec_of(tmp_path, "z_width", "by,K_VE, B_VE\nme,900,0\n\n'you, too',1000,1.5\n".replace("'", '"')))
    assert (walls.B_VE.tolist(), walls.K_VE.tolist(), walls.stable) == ([0.0, 1.5], [900.0, 1000.0], None)
    walls = walls_of(spec_of(tmp_path, "z_width", "B_VE,K_VE,stable\r\n0,0,1\r\n1,2,False\r\n1,3,TRUE\r\n"))
    assert walls.stable.tolist() == [True, False, True]
    found = response_of(spec_of(tmp_path, "response", RESPONSE))
    assert found.admittance == pytest.approx(np.array([0.002, 0.003]) * np.exp(-1j * np.radians([1, 5])))
    parts = "\ufefffrequency_hz,admittance_im,admittance_re,coherence\n1,-2,1,0.5\n"
    found = response_of(spec_of(tmp_path, "response", parts))
    assert (found.admittance.tolist(), found.coherence.tolist()) == ([1 - 2j], [0.5])


def test_a_table_of_bode_is_a_response(tmp_path):
    spec = wavesweep.load({"controller": {"kind": "dc"}, "bode": {"frequency_hz": [0.5, 5.0]}})
    table = wavesweep.bode(spec)
    found = response_of(spec_of(tmp_path, "response", table.to_csv(index=False)))
    assert found.admittance == pytest.approx(table.admittance_re + 1j * table.admittance_im)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("z_width", "B_VE,K\n1,2\n", "expected the columns B_VE and K_VE, found B_VE, K; is K_VE meant|found B_VE, K"),
        ("z_width", "B_VE,k_ve\n1,2\n", "found B_VE, k_ve; is k_ve meant"),
        ("z_width", "", "expected the columns B_VE and K_VE, found nothing"),
        ("z_width", "B_VE,K_VE\n", "expected at least 1 rows of numbers below the header, found 0"),
        ("z_width", "B_VE,K_VE\n0,900\n1,nan\n", r"points.csv:3: K_VE: expected a finite number, found nan"),
        ("z_width", "B_VE,K_VE\n0,900\n\n,950\n", r"points.csv:4: B_VE: expected a number, found nothing"),
        ("z_width", "B_VE,K_VE\n0,900\n1,-5\n", "K_VE: expected numbers of at least 0, found -5"),
        ("z_width", "B_VE,K_VE\n0,900\n1,0\n", "K_VE: expected limits above 0, found 0; .* with a column stable"),
        ("z_width", "B_VE;K_VE\n0;900\n", ":1: expected commas between columns .* found semicolons"),
        ("z_width", "B_VE,K_VE\n0,5,900,0\n", "points.csv:2: .*are these decimal commas"),
        ("z_width", "B_VE,K_VE\n0,900,7\n", "points.csv:2: expected 2 values as in the header, found 3"),
        ("z_width", "B_VE,K_VE,stable\n0,900,yes\n", "points.csv:2: stable: expected 1 or 0, found yes"),
        ("z_width", "B_VE,K_VE\n" + "1,2\n" * (MOST_POINTS + 1), "expected at most 10000 points, found 10001"),
        ("z_width", b"B_VE,K_VE\n\xff\xfe", "expected a CSV file in UTF-8"),
        ("z_width", None, r"points.csv: cannot be read: No such file"),
        (
            "response",
            "hz,admittance_abs,admittance_deg\n1,1,1\n",
            "expected columns admittance_abs .* beside frequency_hz, found hz",
        ),
        ("response", RESPONSE + "2,0.003,-5\n", "expected frequencies above 0 that increase; take one response of several"),
        ("response", RESPONSE + "3,0,-5\n", "admittance_abs: expected an admittance above 0 at every frequency"),
        ("response", RESPONSE.replace("-5", "inf"), "points.csv:3: admittance_deg: expected a finite number, found inf"),
    ],
)
def test_a_file_that_cannot_be_used_is_one_message(name, text, said, tmp_path):
    spec = spec_of(tmp_path, name, text)
    with pytest.raises(UsageError, match=said) as caught:
        (walls_of if name == "z_width" else response_of)(spec)
    assert "\n" not in str(caught.value)


def test_a_drawn_loop_without_wall_or_hand_has_no_measured_ones():
    drawn = {
        "rates": {"tick_hz": 1000},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.0}},
        "wire": {"m.f": "-m.x"},
        "measured": {"z_width": "a.csv", "response": "b.csv"},
    }
    with pytest.raises(SpecError) as caught:
        wavesweep.load(drawn)
    assert [(each.key, each.expected) for each in caught.value.mistakes] == [
        ("measured.z_width", "a wall in [ports], of which it was measured"),
        ("measured.response", "a hand in [ports], of which it was measured"),
    ]


def test_the_spec_names_its_files_and_refuses_other_keys(tmp_path):
    spec = spec_of(tmp_path, "z_width", None)
    assert spec.tables()["measured"] == {"z_width": "points.csv"}
    assert wavesweep.load(spec.tables()).sha256 == spec.sha256 != wavesweep.load({"controller": {"kind": "dc"}}).sha256
    with pytest.raises(SpecError, match=r"measured.zwidth.*did you mean `measured.z_width`"):
        wavesweep.load({"controller": {"kind": "dc"}, "measured": {"zwidth": "a.csv"}})
