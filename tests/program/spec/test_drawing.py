"""A spec that draws its loop is read as a value: its numbers are keys, axes and overrides, and every mistake has its place."""

import pickle
import tomllib

import pytest
from support.drawn import ARM, NETWORK, PD, WALL

import wavesweep
from wavesweep.engine.errors import SpecError
from wavesweep.program.spec import load


def changed(text, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize("text", [ARM, PD, WALL, NETWORK, WALL + '[bode]\nto = "m.v"'])
def test_resolved_tables_are_the_same_spec_again(text):
    spec = load(tomllib.loads(text))
    assert load(spec.tables()).sha256 == spec.sha256
    assert pickle.loads(pickle.dumps(spec.drawing)) == spec.drawing  # noqa: S301 - just made


def test_a_number_is_set_by_its_name_or_path_and_keeps_its_unit(write):
    spec = load(write(ARM), ["kp=5", "numbers.c=2", "rates.tick_hz=20000", 'wire."net.u"=2*arm.x', "block.net.steps=3"])
    assert [spec.values[f"numbers.{name}"] for name in ("kp", "c")] == [5.0, 2.0]
    assert spec.tables()["numbers"]["c"]["unit"] == "N*s/m"
    assert spec.tables()["wire"]["net.u"] == "2*arm.x"
    assert spec.names.keys["numbers.c"].description == "gain of the friction compensation"


def test_whole_numbers_that_decide_the_structure_are_swept_as_values():
    spec = load(tomllib.loads(NETWORK))
    key = spec.names.find("k")
    assert (key.type, key.structural, spec.values["numbers.k"]) == ("integer", True, 10)
    assert spec.with_values({"k": 5}).values["numbers.k"] == 5
    with pytest.raises(SpecError, match=r"expected a whole number, found 5\.5"):
        spec.with_values({"k": 5.5})
    with pytest.raises(SpecError, match="phase: expected a whole number < every = 20, found 20"):
        spec.with_values({"k": 20})


def test_a_number_in_a_block_is_an_axis_by_its_path():
    tables = tomllib.loads(ARM)
    assert "block.net.every" not in load(tables).values
    tables["sweep"] = {
        "block.net.every": [20, 40],
        "along": "block.arm.mass",
        "block": {"arm": {"mass": {"start": 1, "stop": 5}}},
    }
    spec = load(tables)
    assert [axis.path for axis in spec.sweep] == ["block.net.every", "block.arm.mass"]
    assert spec.along == spec.names.find("block.arm.mass").path
    assert spec.values["block.net.every"] == spec.tables()["block"]["net"]["every"] == 20
    assert (spec.names.find("block.net.every").type, spec.names.find("block.net.every").structural) == ("integer", True)
    assert load(spec.tables()).sha256 == spec.sha256
    assert spec.with_values({"block.net.every": 40}).tables()["block"]["net"]["every"] == 40
    with pytest.raises(SpecError, match=r"block\.net\.every: expected a whole number >= 1, found 0"):
        spec.with_values({"block.net.every": 0})


DERIVED = (
    ("kd = 3.0", 'kd = 3.0\nw = "sqrt(kp/m)"\nm = "1*mass"\nmass = 0.2\ncc = { value = "c", unit = "N*s/m" }'),
    ("mass = 0.2\ndamping", 'mass = "m"\ndamping'),
    ("[wire]", '[signals]\nspeed = "arm.v"\nbraking = "kd*speed + w*slow"\nslow = "0*net.y"\n\n[wire]'),
    ("kd*arm.v + c*arm.v", "braking + cc*speed"),
)


def test_numbers_may_follow_from_others_and_signals_have_names(write):
    spec = load(write(changed(ARM, *DERIVED)), ["m=2*mass"])
    assert [name for name, *_ in spec.drawing.numbers] == ["kp", "kd", "mass", "c"]
    assert spec.tables()["numbers"]["m"] == {"value": "2*mass", "unit": "", "description": ""}
    assert spec.tables()["numbers"]["cc"] == {"value": "c", "unit": "N*s/m", "description": ""}
    plain, named = (dict(each.drawing.wires)["arm.f"] for each in (load(write(ARM)), spec))
    values = {s: gain.value({"kp": 7, "kd": 3, "c": 2, "mass": 1}) for s, gain in named}
    assert values == {"net.y": -7, "arm.v": -1, "hand": 1}
    assert [signal for signal, _ in plain] == [signal for signal, _ in named]
    assert load(spec.tables()).sha256 == spec.sha256


def test_names_that_stand_for_ever_more_are_refused(write):
    chain = "\n".join(f'w{i} = "{"+".join([f"w{i - 1}"] * 9)}"' for i in range(1, 30))
    text = changed(ARM, ("kd = 3.0", f"kd = 3.0\nw0 = 1\n{chain}"), ("c*arm.v", "w29*c*arm.v"))
    with pytest.raises(
        SpecError, match="at most 2000 parts, 200 within each other, with those of its names, found more"
    ) as error:
        load(write(text))
    assert len(error.value.mistakes) == 1


def test_a_recursion_by_itself_needs_no_input_and_no_port(write):
    text = """
[rates]
tick_hz = 1
[numbers]
a = 0.5
[block.r]
type = "ss"
inputs = []
outputs = ["y"]
A = [["a", 1], [0, 0.5]]
discrete = true
C = [[1, 0]]
[sweep]
along = "a"
a = { start = -3, stop = 3 }
"""
    found = wavesweep.compile(load(write(text))).stable_intervals()
    assert found[["low", "high", "certified"]].to_numpy().tolist() == [[pytest.approx(-1), pytest.approx(1), True]]
