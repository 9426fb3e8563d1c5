"""Claims: what covers what, and the words and the exit code that follow."""

import json
from dataclasses import replace

import pytest

from wavesweep.program.analyses.claim_words import brief, fact_of, frames_in_words, in_words, messages_in_words, scope_in_words
from wavesweep.program.analyses.claims import (
    AT_REST,
    MEAN_SQUARE,
    PASSIVE_HANDS,
    PUSHES,
    STABLE,
    Chances,
    Claim,
    Frames,
    Messages,
    Order,
    Property,
    Question,
    Range,
    Scope,
    Status,
    Tick,
    answer,
    own_scope,
    questions,
    uncovered,
)
from wavesweep.program.spec import load
from wavesweep.program.tables.refuters import in_a_sentence, repeated

OWN = {"device.mass": 0.1, "rates.ratio": 20.0}
CONSTANT = Frames(Order.CONSTANT, frozenset({20.0}), frozenset({1.0}))
VARYING = Frames(Order.ANY, frozenset({16.0, 20.0, 33.0}), frozenset({1.0}))
MASSES = Range("device.mass", 0.08, 0.125)


def lossy(loss, burst=0.0, burst_end=1.0, burst_loss=1.0):
    """Messages of a channel that are lost at random."""
    chances = {"loss": loss, "burst": burst, "burst_end": burst_end, "burst_loss": burst_loss}
    return Messages("net", 0, 0, tuple(chances.items()))


@pytest.mark.parametrize(
    ("claimed", "asked", "covered"),
    [
        (Scope(frames=VARYING), Scope(frames=CONSTANT), True),
        (Scope(frames=CONSTANT), Scope(frames=VARYING), False),
        (Scope(frames=replace(VARYING, lengths=frozenset({16.0, 20.0}))), Scope(frames=VARYING), False),
        (Scope(frames=replace(VARYING, lost=1)), Scope(frames=replace(VARYING, lost=2)), False),
        (Scope(frames=replace(VARYING, lost=2)), Scope(frames=replace(VARYING, lost=1)), True),
        (Scope(frames=VARYING), Scope(frames=replace(VARYING, order=Order.AT_RANDOM)), False),
        (Scope((MASSES,)), Scope(), True),
        (Scope(), Scope((MASSES,)), False),
        (Scope((MASSES,)), Scope((Range("device.mass", 0.08, 0.12, (0.08, 0.12)),)), True),
        (Scope((Range("device.mass", 0.08, 0.12, (0.08, 0.12)),)), Scope((MASSES,)), False),
        (Scope((Range("device.mass", 0.2, 0.3),)), Scope(), False),  # without the spec's own value
        (Scope(walls=PUSHES), Scope(), True),
        (Scope(), Scope(walls=PUSHES), False),
        (Scope(messages=(Messages("net", 2, 1),)), Scope(messages=(Messages("net", 1, 1),)), True),
        (Scope(messages=(Messages("net", 2, 1),)), Scope(messages=(Messages("net", 3, 1),)), False),
        (Scope(messages=(lossy(0.1),)), Scope(messages=(lossy(0.1),)), True),
        (Scope(messages=(lossy(0.1),)), Scope(messages=(lossy(0.2),)), False),
        (Scope(messages=(lossy(0.1),)), Scope(), False),
        (Scope(messages=(lossy("p"),)), Scope(messages=(lossy(0.2),)), True),  # of a p that is swept
        (Scope(messages=(lossy("p", 0.1),)), Scope(messages=(lossy(0.2),)), False),
        (Scope(hands="passive"), Scope(), False),
        (Scope((Range("device.mass"),)), Scope((MASSES,)), True),  # which no loop reads
        (Scope((MASSES,)), Scope((Range("device.mass"),)), False),
        (Scope(frames=VARYING, run="frames of 16, 33 ticks in turn"), Scope(frames=CONSTANT), False),
    ],
)
def test_a_scope_covers_what_is_a_part_of_it(claimed, asked, covered):
    assert claimed.covers(asked, OWN) == covered


def test_one_refuted_loop_refutes_all_and_one_proved_loop_proves_nothing():
    asked = Question(STABLE, Scope((MASSES,), VARYING))
    own = Scope(frames=CONSTANT)
    proved = Claim(STABLE, own, Status.CERTIFIED)
    refuted = Claim(STABLE, own, Status.REFUTED, "not stable with the spec's own numbers")
    outside = Claim(STABLE, Scope((Range("device.mass", 0.2, 0.3),), CONSTANT), Status.REFUTED)
    everything = Claim(STABLE, asked.scope, Status.PROVED)
    assert answer(asked, [proved], OWN).status is Status.UNKNOWN
    assert answer(asked, [outside], OWN).status is Status.UNKNOWN
    assert answer(asked, [proved, everything], OWN).status is Status.PROVED
    assert answer(asked, [everything, refuted], OWN).status is Status.REFUTED
    assert answer(Question(AT_REST, replace(asked.scope, walls=PUSHES)), [refuted], OWN).status is Status.REFUTED
    assert answer(Question(MEAN_SQUARE, asked.scope), [everything], OWN).status is Status.UNKNOWN


@pytest.mark.asks("for_all", "require", "contact")
def test_a_spec_asks_for_all_of_its_tables():
    varying = {"rates.ratio": {"values": [16, 20], "varying": True}}
    base = {"controller": {"kind": "dc-slow"}, "environment": {"delay": 1}}
    assert questions(load(base)) == [Question(STABLE, own_scope(load(base)))]
    (asked,) = questions(load(base | {"for_all": varying}))
    assert asked.scope.frames == Frames(Order.ANY, frozenset({16, 20}), frozenset({1}))
    (alone,) = questions(load(base | {"for_all": {"loss": 0.1}}))
    assert alone.what == MEAN_SQUARE


@pytest.mark.asks("for_all")
def test_what_is_at_random_is_said_with_its_probabilities():
    def said(table):
        asked = questions(load({"controller": {"kind": "dc-slow"}, "environment": {"delay": 1}, "for_all": table}))
        assert [each.scope.frames.order for each in asked][-1] is Order.AT_RANDOM
        return ", ".join(frames_in_words(asked[-1].scope.frames))

    def lengths(values, **chances):
        return {"rates.ratio": {"values": values, "varying": True, **chances}}

    assert said(lengths([16, 33], shares=[9, 1])) == "frames of 16 (9 of 10) and 33 ticks at random"
    assert said(lengths([33, 16], shares=[9, 1])) == "frames of 16 (1 of 10) and 33 ticks at random"
    after = "(after 16: 16 (1 of 2) and 33; after 33: 16 (1 of 4) and 33)"
    assert said(lengths([33, 16], next=[[3, 1], [1, 1]])) == f"frames of 16, 33 ticks at random {after}"
    delays = {"environment.delay": {"values": [5, 1], "varying": True, "shares": [1, 2]}, "loss": 0.25}
    assert said(delays) == "results 1 (2 of 3) and 5 ticks late at random, results lost with probability 0.25"
    assert messages_in_words(lossy(0.6)) == "messages of net lost with probability 0.6"
    burst = "messages of net lost with probability 0.01, 0.9 in bursts (begun with 0.02, ended with 0.1)"
    assert messages_in_words(lossy(0.01, 0.02, 0.1, 0.9)) == burst


def test_constant_numbers_are_told_from_those_that_follow_in_any_order():
    lengths = Range("rates.ratio", 14, 29, (14.0, 18.0, 29.0))
    assert scope_in_words(Scope((lengths,))) == "for rates.ratio of 14, 18, 29 (each for ever)"
    assert "in any order" in scope_in_words(Scope(frames=VARYING))


def test_numbers_that_bound_a_set_are_within_it_and_members_are_themselves():
    ends = Scope((Range("device.mass", 0.081234561, 0.1234567),))
    low, high = map(float, scope_in_words(ends).removeprefix("for device.mass from ").split(" to "))
    assert 0.081234561 <= low < high <= 0.1234567
    assert high - low == pytest.approx(0.1234567 - 0.081234561, rel=1e-4)
    members = Scope((Range("device.mass", 0.1, 0.2, (0.1234567, 0.2)), Range("K", 1 / 3, 1 / 3, (1 / 3,))))
    assert "0.1234567, 0.2" in scope_in_words(members)
    assert repr(1 / 3) in scope_in_words(members)


def test_each_channel_has_its_own_chances_also_in_a_line():
    first = Messages("there", 0, 0, lossy(0.05).chances)
    second = Messages("back", 0, 0, lossy(0.02, 0.01, 0.25).chances)
    said = scope_in_words(Scope(messages=(first, second)))
    assert "there lost with probability 0.05" in said
    assert "back lost with probability 0.02, 1 in bursts (begun with 0.01, ended with 0.25)" in said


def test_what_some_loops_do_not_have_is_not_said_as_if_none_had_it():
    frames = "for all frames of 16, 20, 33 ticks in any order"
    hands = Claim(STABLE, Scope(frames=VARYING, hands=PASSIVE_HANDS), Status.REFUTED, "frames 33")
    assert in_words(hands) == f"not stable {frames} and all passive hands: frames 33"
    walls = Claim(AT_REST, Scope(walls=PUSHES), Status.REFUTED, "a wall")
    assert in_words(walls) == "does not come to rest for all walls up to K_VE, B_VE that push and never pull: a wall"
    assert brief(walls) == "does not come to rest for all of these"
    one = Claim(STABLE, Scope((Range("K", 3.0, 3.0, (3.0,)),)), Status.REFUTED)
    assert in_words(one) == "not stable for K = 3"


@pytest.mark.parametrize(
    "claim",
    [
        Claim(STABLE, Scope((MASSES, Range("p")), VARYING, (Messages("net", 2, "2*n - 1"),)), Status.PROVED),
        Claim(
            MEAN_SQUARE,
            Scope(frames=replace(VARYING, order=Order.AT_RANDOM, chances=Chances(((0.5, 0.2, 0.3),), ((0.9, 0.1),)))),
            Status.PROVED,
        ),
        Claim(MEAN_SQUARE, Scope(messages=(lossy("p/2"),)), Status.PROVED),
        Claim(
            Property("every mode within 0.9 per tick", "requirement"), Scope(tick=Tick(1e-3, 2e-3)), Status.CHECKED, "the lines"
        ),
        Claim(Property("a run", "figures"), Scope(run="all messages in time"), Status.COMPUTED),
    ],
)
def test_a_claim_is_read_from_the_facts_of_a_table_as_it_was_written(claim):
    fact = json.loads(json.dumps(fact_of(claim)))
    assert Claim.read(fact) == claim
    assert fact["said"].endswith(scope_in_words(claim.scope))


@pytest.mark.asks("for_all", "contact")
def test_what_a_spec_asks_beyond_the_claims_of_a_table_is_named():
    varying = {"for_all": {"rates.ratio": {"values": [16, 20], "varying": True}}}
    spec = load({"controller": {"kind": "dc-slow"}, "environment": {"delay": 1}} | varying)
    (beyond,) = uncovered(spec, [own_scope(spec)])
    assert scope_in_words(beyond) == "for frames of 16, 20 ticks in any order"
    assert not [*uncovered(spec, [beyond])]
    alone = load({"controller": {"kind": "dc-slow"}, "for_all": {"contact": True}})
    assert [each.walls for each in uncovered(alone, [own_scope(alone)])] == [PUSHES]


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        ("16", "16"),
        ("16, 16, 16, 33", "16 x 3, 33"),
        ("16, 16, 16, 33, 16, 16, 16, 33", "(16 x 3, 33) x 2"),
        ("16, 33, 33", "16, 33, 33"),
        ("16, 33, 33, 33, 16", "16, (33 x 3), 16"),
        ("16, 33, 16, 33, 20", "16, 33, 16, 33, 20"),
        ("16 (lost), 16 (lost)", "16 (lost) x 2"),
    ],
)
def test_a_pattern_is_written_by_its_repetitions(pattern, said):
    assert repeated(pattern.split(", ")) == said
    assert in_a_sentence(f"K = 2, frames {pattern}, a hand") == f"K = 2, frames {said}, a hand"


REFUSED = """
[controller]
kind = "dc-slow"
[environment]
delay = 1
K_VE = 100
[device]
damping = 5
[sweep]
K_VE = { start = 0, stop = 5000 }
"""


@pytest.mark.asks("check", "require")
@pytest.mark.parametrize(
    ("settings", "code", "first"),
    [
        ([], 0, "mine, dc-slow: stable (spectral radius"),
        (["sweep.require={ radius = 0.5 }"], 1, "mine, dc-slow: not as required, every mode within 0.5 per T_s"),
        (["sweep.require={ radius = 0.9 }"], 0, "mine, dc-slow: as required, every mode within 0.9 per T_s, certified"),
        (["K_VE=4000"], 1, "mine, dc-slow: UNSTABLE"),
    ],
)
def test_check_begins_with_the_verdict_and_strict_ends_with_it(settings, code, first, wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(REFUSED)
    told = [word for each in settings for word in ("--set", each)]
    found, out, _ = wavesweep("check", "mine.toml", *told, "--strict")
    assert found == code
    assert out.startswith(first)
    assert wavesweep("check", "mine.toml", *told, "--quiet")[0] == 0
