"""Rows and verdicts of what [sweep] require asks of gains, in proof files."""

import pytest
from support.proofs import checked_file, written

pytest.importorskip("wavesweep.require", reason="[sweep] require is its key")

# L = K/(z - 1): Ms = 2/(2 - K) is 1.6 at K = 0.75, and 1 over the disk margin 2/(2 - K) - 1/2
SPEC = """
rates.tick_hz = 100
numbers = { K = 0.5 }
[block]
sum = { type = "integrator" }
gain = { type = "gain", k = "100*K" }
[wire]
"sum.u" = "ref - gain.y"
"gain.u" = "sum.y"
[ports]
inputs = { ref = "ref" }
outputs = { y = "sum.y" }
[sweep]
along = "K"
K = { start = 0.1, stop = 1.5 }
require.margins = { cut = "gain.y", Ms = 1.6, disk = 0.8 }
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
