"""`explain` knows every word that tables, verdicts and messages have, in a few lines each."""

import json

import pytest

from wavesweep.explain.command import _lines, entries
from wavesweep.explain.words import MESSAGES, TERMS
from wavesweep.program.tables import kinds
from wavesweep.program.tables.fields import DOUBTS


def test_all_words_of_doubt_columns_and_values_are_explained_in_five_lines_at_most():
    words = {each.word for each in entries()}
    columns = [field for kind in kinds().values() for field in kind.fields]
    assert {*filter(None, DOUBTS), *(field.name for field in columns)} <= words
    assert {value for field in columns for value in field.values} <= words
    assert {word for each in (TERMS, MESSAGES) for names in each for word in names.split(", ")} <= words
    assert [each.word for each in entries() if len([*_lines(each)]) > 5] == []
    assert [each.word for each in entries() if each.group in ("doubt", "message") and not each.advice] == []


@pytest.mark.whole
def test_a_word_is_found_however_it_is_spelt_and_with_all_its_meanings(wavesweep):
    code, out, _ = wavesweep("explain", "Felt_Low", "--json")
    assert (code, list(json.loads(out))) == (0, ["felt_low"])
    found = json.loads(wavesweep("explain", "swept", "range", "ends", "--json")[1])
    assert "Make the range in [sweep] longer" in found["swept range ends"][0]["advice"]
    assert len(json.loads(wavesweep("explain", "certified", "--json")[1])["certified"]) > 4


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("crowdet", "did you mean crowded?"),
        ("K_VF", "did you mean K_VE?"),
        ("stability-regio", "did you mean stability-region?"),
        ("butterwort", "did you mean butterworth?"),
        ("nonsense", "`wavesweep explain` lists all words"),
    ],
)
def test_an_unknown_word_is_refused_with_the_nearest(wavesweep, word, said):
    code, out, err = wavesweep("explain", word)
    assert (code, out) == (2, "")
    assert said in err


def test_keys_and_commands_lead_to_their_own_explanations_and_all_words_fit_on_a_screen(wavesweep):
    assert "wavesweep keys b" in wavesweep("explain", "b")[1]
    assert "wavesweep zwidth --help" in wavesweep("explain", "zwidth")[1]
    lines = wavesweep("explain")[1].splitlines()
    assert (max(map(len, lines)) <= 100, len(lines) < 60) == (True, True)


RING = """
rates.tick_hz = 10
numbers.k = 1.0
block.x = { type = "integrator", method = "explicit" }
block.v = { type = "integrator", method = "implicit" }
wire = { "x.u" = "v.y", "v.u" = "-k*x.y" }
"""


@pytest.mark.whole
def test_a_doubt_in_check_leads_to_its_explanation(wavesweep, tmp_path):
    """The eigenvalues of the ring stay on the circle, whatever k is."""
    (tmp_path / "ring.toml").write_text(RING)
    code, out, _ = wavesweep("check", str(tmp_path / "ring.toml"))
    words = [word for word in DOUBTS if word and f"({word})" in out]
    assert (code, len(words), len(out.splitlines()) <= 15) == (0, 1, True)
    assert out.count(f"  wavesweep explain {words[0]}") == 1
