"""Rows and verdicts of what [sweep] require asks of gains, in proof files."""

import gzip
import json

import numpy as np
import pytest
from checker.test_gains import LOOP
from support.proofs import checked_file, lines_of, written

from wavesweep.checker.factor import FACTOR

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


@pytest.fixture(scope="module")
def margins(tmp_path_factory):
    return written(tmp_path_factory.mktemp("margins"), SPEC, "margins", "--cut", "gain.y", "--no-plot")


def test_margins_are_proved_to_their_closed_forms(margins):
    # 1/(1 + L) = (z - 1)/(z - 1 + K) with K = 1/2: 4/3 at z = -1, 1 less 4/3 - 1/2 and 1/3; any factor up to 4, phases to
    # where |L| = 1, 2 sin(theta/2) = K, at which L has -90 deg - theta/2
    code, words = checked_file(*margins)
    assert code == 0
    proved = words.splitlines()[:5]
    sides = [line.split("of the signal")[1].split(", ")[0] for line in proved[:2]]
    assert [float(side.split()[-1]) for side in sides] == pytest.approx([4, 90 - np.degrees(np.arcsin(0.25))], rel=1e-8)
    levels = [float(line.split("below ")[1].split()[0]) for line in proved[2:]]
    assert levels == pytest.approx([5 / 6, 4 / 3, 1], rel=2e-6)
    assert all(line.startswith("proved: ") for line in proved)


@pytest.mark.parametrize(
    ("number", "change", "code", "why"),
    [
        (1, {"sides": {FACTOR: ["1e-08", "4.000001"]}}, 1, "does not decrease"),
        (1, {"cut": "sum.y"}, 3, "at gain.y: NOT COVERED"),
        (1, {"cut": "nowhere.y"}, 1, "nothing is made at the cut"),
        (2, {"cut": ""}, 2, "is no number of this spec"),
        (3, {"gain": {"cut": "gain.y", "less": "0.5", "at_most": "0.8333"}}, 1, "the gain may be"),
    ],
)
def test_more_than_margins_is_refused(margins, tmp_path, number, change, code, why):
    spec, proof = margins
    lines = lines_of(proof)
    heads = [line for line in lines if "claim" in line]
    heads[number - 1] |= change
    forged = tmp_path / "forged.proof"
    with gzip.open(forged, "wt") as file:
        file.writelines(json.dumps(line) + "\n" for line in lines)
    found = checked_file(spec, forged)
    assert found[0] == code
    assert why in found[1]


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
