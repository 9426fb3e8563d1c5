"""Files of measured points: what is read, and one message for each that cannot be used."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.identification.panel import data
from wavesweep.identification.points import read_response, response_of, walls_of

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


def test_a_page_has_the_walls_with_whether_they_were_stable_and_the_response(tmp_path):
    found = data(spec_of(tmp_path, "z_width", "B_VE,K_VE,stable\n0,900,1\n1.5,1000,0\n"))["measured"]["walls"]
    assert found["points"] == [(0.0, 900.0, True), (1.5, 1000.0, False)]
    assert (found["stiffness"], found["damping"]) == ("environment.K_VE", "environment.B_VE")
    (limit,) = data(spec_of(tmp_path, "z_width", "B_VE,K_VE\n0,900\n"))["measured"]["walls"]["points"]
    assert limit == (0.0, 900.0, None)
    found = data(spec_of(tmp_path, "response", RESPONSE))["measured"]
    assert {*found} == {"response"}
    assert found["response"]["frequency_hz"] == [1, 2]


@pytest.mark.parametrize(("coherence", "taken"), [("1.00000011", True), ("1.01", False)])
def test_a_coherence_a_rounding_above_1_is_1(tmp_path, coherence, taken):
    path = tmp_path / "frf.csv"
    path.write_text(f"frequency_hz,admittance_re,admittance_im,coherence\n1,1,-1,{coherence}\n2,1,-2,0.9\n")
    if taken:
        assert read_response(path, 1).coherence.tolist() == [1.0, 0.9]
    else:
        with pytest.raises(UsageError, match="at most 1"):
            read_response(path, 1)


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
        ("measured.z_width", "a wall in [ports], where it was measured"),
        ("measured.response", "a hand in [ports], where it was measured"),
    ]


def test_the_spec_names_its_files_and_refuses_other_keys(tmp_path):
    spec = spec_of(tmp_path, "z_width", None)
    assert spec.tables()["measured"] == {"z_width": "points.csv"}
    assert wavesweep.load(spec.tables()).sha256 == spec.sha256 != wavesweep.load({"controller": {"kind": "dc"}}).sha256
    with pytest.raises(SpecError, match=r"measured.zwidth.*did you mean `measured.z_width`"):
        wavesweep.load({"controller": {"kind": "dc"}, "measured": {"zwidth": "a.csv"}})


def test_a_cell_that_is_too_long_is_named_as_such(tmp_path):
    rows = "".join(f"{n},{100 + n},1\n" for n in range(20))
    with pytest.raises(UsageError, match=r"points.csv: expected cells of at most 131072 letters"):
        walls_of(spec_of(tmp_path, "z_width", f"B_VE,K_VE,stable\n{rows}20,1,{'1' * 140_000}\n"))


def test_walls_and_responses_of_another_kind_of_hand_are_refused(tmp_path):
    with pytest.raises(UsageError, match=r"points.csv: K_VE \(N\*m/rad\): expected N/m, found N\*m/rad"):
        walls_of(spec_of(tmp_path, "z_width", "B_VE,K_VE (N*m/rad)\n0,900\n1,1000\n"))


def test_a_response_has_the_units_in_the_names_of_its_columns(tmp_path):
    path = tmp_path / "frf.csv"
    path.write_text("frequency_hz,FRF (mm/N),phase (rad)\n1,2,-1\n2,3,-0.5\n")
    columns = {"admittance_abs": "FRF (mm/N)", "admittance_deg": "phase (rad)"}
    found = read_response(path, 1, columns=columns)
    assert found.admittance == pytest.approx(np.array([2e-3, 3e-3]) * np.exp([-1j, -0.5j]), rel=1e-14)
    path.write_text("frequency_hz,FRF (dB),phase (rad)\n1,2,-1\n2,3,-0.5\n")
    with pytest.raises(UsageError, match=r"expected m/N or rad/\(N\*m\), found dB; --scale admittance=FACTOR"):
        read_response(path, 1, columns=columns | {"admittance_abs": "FRF (dB)"})
