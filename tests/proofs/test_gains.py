"""Rows and verdicts of what [sweep] require asks of gains, in proof files."""

import numpy as np
import pytest
from checker.test_gains import LOOP
from support.proofs import changed, checked_file, lines_of, written

from wavesweep.checker.factor import FACTOR
from wavesweep.program import cli

pytest.importorskip("wavesweep.require", reason="[sweep] require is its key")

# Ms of the loop is 2/(2 - K), 1.6 at K = 0.75, and 1 over its disk margin 2/(2 - K) - 1/2
SPEC = f"""{LOOP}
require.margins = {{ cut = "gain.y", Ms = 1.6, disk = 0.8 }}
"""


@pytest.mark.slow
def test_rows_are_proved_up_to_what_they_leave_open(tmp_path):
    code, words = checked_file(*written(tmp_path, SPEC, "stability-region"))
    assert code == 0
    asked = words.splitlines()[-1].split("; ")
    for line, function, level in zip(asked, ("|1/(1 + L)|", "|1/(1 + L) - 0.5|"), ("1.6", "1.25"), strict=True):
        assert line.startswith(
            f"K from 0.1 to 1.5 for {function} at gain.y below {level} at all frequencies: proved below to 0.7"
        )
        assert line.endswith("(53.57 %)")


# Stable with factors up to 2/K, and phases up to 90 deg - arcsin(K/2); |y/ref| is 0.01/K at rest, 0.01/(2 - K) at z = -1
FACTORS = 'margins = { cut = "gain.y", gain = 2, phase_deg = 60 }'
PEAK = 'peak = { from = "ref", to = "y", at_most = 0.02 }'


@pytest.mark.slow
@pytest.mark.parametrize(("asked", "ends"), [(FACTORS, [(0.1, 1), (0.1, 1)]), (PEAK, [(0.5, 1.5)])])
def test_rows_of_factors_and_of_peaks_are_proved_to_closed_forms(tmp_path, asked, ends):
    spec, proof = written(tmp_path, f"{LOOP}\nrequire.{asked}\n", "stability-region", "--no-plot")
    code, words = checked_file(spec, proof)
    assert (code, words.count("proved: ")) == (0, len(ends)), words
    heads = [line for line in lines_of(proof) if "claim" in line]
    for head, (low, high) in zip(heads, ends, strict=True):
        assert [float(end) for end in head["sides"]["K"]] == pytest.approx([low, high], rel=1e-4)
        assert float(head["sides"]["K"][1]) <= high
    assert not cli.main(["verify", str(proof.parent)])


@pytest.mark.slow
def test_a_factor_beyond_a_row_is_refused(tmp_path):
    spec, proof = written(tmp_path, f"{LOOP}\nrequire.{FACTORS}\n", "stability-region", "--no-plot")
    wider = {FACTOR: ["0.5", "2.001"]}
    changed(proof, lambda line: line | {"sides": line["sides"] | wider} if FACTOR in line.get("sides", {}) else line)
    code, words = checked_file(spec, proof)
    assert code == 1
    assert "does not decrease" in words


@pytest.mark.slow
def test_a_design_is_proved_to_keep_its_margins(tmp_path):
    code, words = checked_file(*written(tmp_path, SPEC, "check"))
    assert code == 0
    assert "own numbers for |1/(1 + L)| at gain.y below 1.6 at all frequencies: proved below" in words


@pytest.mark.parametrize("more", ["gain = { from = 'ref', to = 'y', at_most = 9, band_hz = [1, 2] }", "radius = 0.99"])
def test_what_has_no_inequality_has_no_file(tmp_path, capsys, more):
    _, proof = written(tmp_path, f"{SPEC}require.{more}\n", "stability-region")
    assert not proof.exists()
    assert "no proof file for what [sweep] require asks for" in capsys.readouterr().err


def test_margins_are_proved_to_their_closed_forms(tmp_path):
    # 1/(1 + L) = (z - 1)/(z - 1 + K) with K = 1/2: 4/3 at z = -1, 1 less 4/3 - 1/2 and 1/3; any factor up to 4, phases to
    # where |L| = 1, 2 sin(theta/2) = K, at which L has -90 deg - theta/2
    code, words = checked_file(*written(tmp_path, SPEC, "margins", "--cut", "gain.y", "--no-plot"))
    assert code == 0
    proved = words.splitlines()[:5]
    sides = [line.split("of the signal")[1].split(", ")[0] for line in proved[:2]]
    assert [float(side.split()[-1]) for side in sides] == pytest.approx([4, 90 - np.degrees(np.arcsin(0.25))], rel=1e-8)
    levels = [float(line.split("below ")[1].split()[0]) for line in proved[2:]]
    assert levels == pytest.approx([5 / 6, 4 / 3, 1], rel=2e-6)
    assert all(line.startswith("proved: ") for line in proved)


def test_margins_for_all_numbers_are_asked_and_have_no_file(tmp_path):
    spec = SPEC.replace("[sweep]", "[for_all]\nK = { start = 0.4, stop = 0.6 }\n[sweep]").replace(
        'along = "K"\nK =', 'along = "a"\na ='
    )
    spec = spec.replace("numbers = { K = 0.5 }", "numbers = { K = 0.5, a = 1.0 }").replace('"100*K"', '"100*K*a"')
    spec = spec[: spec.index("require.margins")]
    code, words = checked_file(*written(tmp_path, spec, "margins", "--cut", "gain.y", "--no-plot"))
    assert code == 3
    assert "for margins for all of [for_all] at gain.y: NOT COVERED" in words
    assert words.count("proved: ") == 5
