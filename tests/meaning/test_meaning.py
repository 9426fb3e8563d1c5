"""What a spec is taken to mean, against an interpreter of the documents that shares nothing with the package."""

import shutil
import tomllib

import numpy as np
import pytest
from meaning import exported
from meaning.attacked import judge_attacked
from meaning.coverage import drawn, uncovered
from meaning.faults import judge_fault
from meaning.judge import compiled, judge
from meaning.pairs import judge_pair
from meaning.reading import machine_of, radius_of, with_numbers
from meaning.required import Case, judge_bounded, judge_case, judge_required
from meaning.rewritten import judge_rewritten
from meaning.sets import KINDS as KINDS_OF_SETS
from meaning.sets_rewritten import judge_rewritten_set
from meaning.specs import KINDS, conserving, linkage, spec_text, toml

from wavesweep.program.cli import main

pytestmark = pytest.mark.asks("simulation")  # whose runs are compared too

SPECS = 300
EACH = 10  # specs of one test

EXPLICIT = {"integration": "explicit", "delay": "frame"}

REQUIRED = [  # a spec of each kind that takes little time
    (1, "radius"), (6, "settling"), (22, "time_constant"), (307, "damping_ratio"), (91, "gain"),
    (15, "overshoot"), (57, "step_settling"), (37, "rms"), (80, "peak"), (127, "peak"), (55, "Ms"), (89, "disk"),
    (435, "margins.gain"), (93, "phase_deg"),
]  # fmt: skip
RARE = (14, 72, 19, 27, 17, 69, 59, 107, 153)  # of specs that have what most do not
ATTACKED = (87, 27, 30, 6)  # numbers of sets that take little time
BEHIND_CHANNELS = (18, 26, 98, 137, 164, 176, 198, 200, 222, 248, 272, 473)
SETS_REWRITTEN = (30, 66, 72)  # the same
PAIRS = (39, 55, 64, 66, 77, 88, 96, 102)  # of two keys that both readers take, some by --set
CUT = (368, 580, 595, 797, 1353)  # commands at signals of plants, of impulses, and of loops without states
REWRITTEN = (2, 7, 29, 70, 498)  # numbers of specs that take little time


@pytest.mark.parametrize(
    ("tables", "limit"),
    [
        ({}, 263.137165166),
        ({"environment": {"delay": 20}}, 82.579018996),
        ({"environment": {"delay": "frame"}}, 82.579018996),
        ({"rates": {"slow_hz": 400}, "device": {"velocity": "difference"}, "environment": EXPLICIT}, 576.5787485710594),
        ({"rates": {"slow_hz": 400}, "device": {"velocity": "difference"}}, 1465.2120138286),
    ],
)
def test_the_interpreter_finds_published_limits(tables, limit):
    tables = {"controller": {"kind": "dc-slow"}, **tables}
    assert radius_of(with_numbers(tables, {"K_VE": limit * (1 - 1e-8)}), 0) < 1
    assert radius_of(with_numbers(tables, {"K_VE": limit * (1 + 1e-8)}), 0) > 1


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, SPECS, EACH))
def test_random_specs_mean_the_same(first, tmp_path):
    """Radius and simulation of each; ends and responses of each ninth, which take longer."""
    differ = []
    for number in range(first, first + EACH):
        text = spec_text(number, quick=True)
        found = judge(text, compiled(text, tmp_path), whole=number % 9 == 0, required=False)
        differ += [(number, one.what, one.mine, one.theirs) for one in found if not one.same]
    assert differ == []


@pytest.mark.parametrize("number", RARE)
def test_what_is_rare_means_the_same(number, tmp_path):
    """A preset beside a mass, defaults, `prev` of an impulse, names in plants, direct terms, other axes, `through`."""
    text = spec_text(number, quick=True)
    assert [one for one in judge(text, compiled(text, tmp_path), 40, whole=False) if not one.same] == []


@pytest.mark.parametrize("number", REWRITTEN)
def test_a_spec_in_other_words_has_the_same_answers(number, tmp_path):
    assert [(one.what, one.mine, one.theirs) for one in judge_rewritten(number, tmp_path) if not one.same] == []


@pytest.mark.parametrize("number", PAIRS)
def test_keys_that_may_override_each_other_mean_the_same(number):
    """By any of their names, in the spec, in [sweep] and [for_all], and by --set."""
    assert [one for one in judge_pair(number) if not one.same] == []


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 200, 20))
def test_two_keys_are_taken_or_refused_by_both_readers(first):
    """And mean the same to 1e-9 of a radius where they are taken, with the same sets."""
    assert [(number, one) for number in range(first, first + 20) for one in judge_pair(number) if not one.same] == []


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # the limit may end a callback
@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 40, 10))
def test_commands_end_in_answers_or_sentences(first):
    """Of random specs and options; half a second of each."""
    numbers = [*range(first, first + 10), *CUT[first // 10 :: 4]]
    assert [one for number in numbers for one in judge_fault(number) if not one.same] == []


@pytest.mark.parametrize("number", ATTACKED)
def test_what_is_claimed_of_a_set_withstands_an_attack(number):
    """A mass that varies, which is refused; ranges; messages lost at random before a dead time."""
    assert [one for one in judge_attacked(number) if not one.same] == []


@pytest.mark.parametrize("number", SETS_REWRITTEN)
def test_a_set_in_other_words_has_the_same_rows(number):
    assert [one for one in judge_rewritten_set(number) if not one.same] == []


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 48, 8))
def test_sets_in_other_words_have_the_same_rows(first):
    """Seconds as steps, half a tick, a list of one value, an inertia as a mass, a channel in time as a hold."""
    numbers = [*range(first, first + 3), *BEHIND_CHANNELS[first // 8 :: 12]]
    assert [(number, one) for number in numbers for one in judge_rewritten_set(number) if not one.same] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", range(len(KINDS_OF_SETS)), ids=[kind.__name__ for kind in KINDS_OF_SETS])
def test_what_is_claimed_of_sets_withstands_an_attack(kind):
    """Sets of each kind, and dead times in seconds behind channels."""
    numbers = [kind, kind + len(KINDS_OF_SETS), BEHIND_CHANNELS[kind]]
    assert [(number, one) for number in numbers for one in judge_attacked(number) if not one.same] == []


@pytest.mark.slow
@pytest.mark.parametrize(("number", "kind"), REQUIRED)
def test_requirements_mean_the_same(number, kind, tmp_path):
    """Inside and outside of each end, and in between, where a march says whether it is kept."""
    text = spec_text(number, quick=True)
    found = judge_required(text, compiled(text, tmp_path))
    assert any(kind in one.what and "untold" not in one.what and "doubt" not in one.what for one in found)
    assert [one for one in found if not one.same] == []


@pytest.mark.parametrize("seed", [1, 3])
def test_loops_that_conserve_energy_grow_where_their_rows_end(seed, tmp_path):
    tables = conserving(seed)
    assert [one for one in judge_bounded(tables, compiled(toml(tables), tmp_path)) if not one.same] == []


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [("five-bar", 3), ("pantograph", 4), ("delta", 1)])
def test_devices_of_several_axes_in_any_pose_mean_the_same(kind, seed, tmp_path):
    text = toml(linkage(seed, kind))
    assert [one for one in judge(text, compiled(text, tmp_path), required=False) if not one.same] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_exported_c_means_the_same(kind, tmp_path):
    """The C gets the interpreter's positions and speeds, and makes the interpreter's force of them."""
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("no gcc")
    numbers = [2 * (8 * at + KINDS.index(kind)) for at in range(40)]
    tables = next(spec for spec in map(_exportable, numbers) if spec)
    path = tmp_path / "spec.toml"
    path.write_text(toml(tables))
    assert main(["export", str(path), "--to", "c", "--out", str(tmp_path / "c"), "--quiet"]) == 0
    force = np.random.default_rng(5).normal(size=150)
    mine = machine_of(tables).run(force, "hand", ["x", "v", "f_m"])
    theirs = exported.forces(compiler, tmp_path / "c", mine["x"], mine["v"])
    np.testing.assert_allclose(-theirs, mine["f_m"], rtol=1e-8, atol=1e-9 * abs(mine["f_m"]).max())


TWO_DRIFTS = """
rates.tick_hz = 1000
numbers.K = 5.0
[block]
arm = { type = "mass", mass = 0.1, damping = 1.0, stiffness = 20.0 }
pull = { type = "impulse" }
end = { type = "wave", b = 4 }
far = { type = "avatar", b = 4 }
back = { type = "hold", every = 2 }
[wire]
"pull.u" = "arm.x"
"end.v" = "arm.v"
"end.in" = "back.y"
"far.in" = "end.out"
"far.f" = "15*far.x_spring"
"back.u" = "far.out"
"arm.f" = "push - K*pull.y - end.force"
[ports]
hand = { force = "push", displacement = "arm.x" }
[sweep]
along = "K"
K = { start = 0, stop = 100 }
"""


@pytest.mark.parametrize("kind", ['"impulse"', '"pi", kp = 1.0', '"pid", kp = 1.0, kd = 0.002, tau = 0.004'])
def test_a_sum_that_nothing_reads_counts_beside_a_line_of_waves(tmp_path, kind):
    """An impulse in each tick is a gain, and so is an integral without a gain; "no K" was certified of stable loops."""
    text = TWO_DRIFTS.replace('"impulse"', kind)
    loop = compiled(text, tmp_path)
    assert [one for one in judge(text, loop, required=False) if not one.same] == []
    table = loop.stable_intervals()
    assert table[["low", "high"]].to_numpy().tolist() == [[0.0, 100.0]]
    assert table["certified"].all()


DRIFT_THAT_TURNS = """
rates.tick_hz = 1000
numbers.K = 80.0
[block]
arm = { type = "mass", mass = 0.1, damping = 4.0 }
eye = { type = "hold", every = 2 }
sum = { type = "integrator", method = "implicit" }
[wire]
"eye.u" = "arm.x"
"sum.u" = "arm.v"
"arm.f" = "push - K*eye.y + 30*sum.y"
[ports]
hand = { force = "push", displacement = "arm.x" }
[sweep]
along = "K"
K = { start = 60, stop = 300 }
"""


def test_a_drift_whose_direction_depends_on_the_number_is_taken_away_of_complex_numbers_too(tmp_path):
    """Rest is where the sum is K/30 times the position; bounds come from circles of complex K, where it is that of these."""
    tables = tomllib.loads(DRIFT_THAT_TURNS)
    case = Case(tables, "K", (60.0, 300.0), 1, {"rms": {"from": "push", "to": "arm.v", "at_most": 0.03609}})
    found = judge_case(case, compiled(DRIFT_THAT_TURNS, tmp_path))
    assert [one for one in found if not one.same] == []
    assert sum(one.what == "required rms, end" for one in found) == 2


def _exportable(number):
    """A spec whose rates do not divide; the amplifier's delay is the device's and not in the C."""
    tables = tomllib.loads(spec_text(number, quick=True))
    device = tables["device"]
    for key in ("delay", "dead_time"):
        device.pop(key, None)
    return tables if "slow_hz" in tables["rates"] and "preset" not in device else None


@pytest.mark.slow
def test_every_key_is_drawn_or_listed():
    """Of those that `wavesweep keys` prints, and most of them are left to their defaults as well."""
    given, left_out = drawn(300)
    assert uncovered(given) == []
    assert len(left_out.keys() & given.keys()) > 90
