"""A spec that draws its loop is read as a value: its numbers are keys, axes and overrides, and every mistake has its place."""

import pickle
import tomllib

import pytest
from support.drawn import ARM, NETWORK, PD, WALL
from support.specs import nested

import wavesweep
from wavesweep.errors import SpecError, UsageError
from wavesweep.spec import load, sweep_axes
from wavesweep.spec.block_types import COLUMNS, LONGEST_FRAME
from wavesweep.spec.block_types import TYPES as BLOCKS
from wavesweep.spec.drawing import OF_PLANT
from wavesweep.spec.drawing_keys import NAME
from wavesweep.spec.drawing_tables import KNOWN
from wavesweep.spec.expressions import value_of
from wavesweep.tables import kind_named


def changed(text, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def mistakes(source, *overrides):
    with pytest.raises(SpecError) as error:
        load(source, overrides)
    return str(error.value).splitlines()


def test_values_are_the_numbers_and_the_rate():
    spec = load(tomllib.loads(ARM))
    assert dict(spec.values) == {"rates.tick_hz": 10000.0, "numbers.kp": 240.0, "numbers.kd": 3.0, "numbers.c": 0.0}
    assert (spec.along, spec.kind, [axis.path for axis in spec.sweep]) == ("c", "drawn", ["numbers.c", "numbers.kp"])


@pytest.mark.parametrize("text", [ARM, PD, WALL, NETWORK])
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


def test_a_number_with_the_name_of_a_built_in_symbol_is_the_drawings_own(write):
    text = changed(PD, ("kp", "b"))
    assert load(write(text), ["b=7"]).values["numbers.b"] == 7.0
    assert load(write(text), ["sweep.b=[1, 2]"]).sweep[0].path == "numbers.b"


@pytest.mark.parametrize(
    ("table", "slip"),
    [("[rates]", "[rate]"), ("[numbers]", "[number]"), ("[wire]", "[wires]"), ("[ports]", "[port]"), ("[block.", "[blocks.")],
)
def test_a_table_with_a_wrong_name_is_one_mistake(write, table, slip):
    """It is read as the one that is meant, so that all that needs it is no mistake as well."""
    (line,) = mistakes(write(changed(ARM, (table, slip))))
    name = table.strip("[].")
    assert f": {slip.strip('[].')}: expected one of the tables" in line
    assert line.endswith(f"found an unknown table; did you mean `{name}`?")


def test_ticks_say_that_a_loop_is_drawn_although_all_its_other_tables_have_wrong_names(write):
    slips = {"[numbers]": "[number]", "[wire]": "[wires]", "[ports]": "[port]", "[block.": "[blocks."}
    lines = mistakes(write(changed(ARM, *slips.items())))
    assert [line.split(": ")[1] for line in lines] == ["number", "blocks", "wires", "port"]
    assert all("did you mean" in line for line in lines)


def test_a_number_of_set_that_there_is_not_is_told_the_next_one(write):
    for given, meant in (("kpp=4", "kp"), ("KD=1", "kd"), ("arm.mass=2", "block.arm")):
        (line,) = mistakes(write(ARM), given)
        assert line.endswith(f"; did you mean `{meant}`?")


def test_whole_numbers_that_decide_the_structure_are_swept_as_values():
    spec = load(tomllib.loads(NETWORK))
    key = spec.names.find("k")
    assert (key.type, key.structural, spec.values["numbers.k"]) == ("integer", True, 10)
    assert spec.with_values({"k": 5}).values["numbers.k"] == 5
    with pytest.raises(SpecError, match=r"expected a whole number, found 5\.5"):
        spec.with_values({"k": 5.5})
    with pytest.raises(SpecError, match="phase: expected a whole number < every = 20, found 20"):
        spec.with_values({"k": 20})


def test_a_rate_may_be_an_expression():
    spec = load(tomllib.loads(changed(PD, ("tick_hz = 1000", 'tick_hz = "1000*m"'))))
    assert "rates.tick_hz" not in spec.values
    assert spec.drawing.rate(spec.values) == 200.0
    assert spec.drawing.rating == {"m"}
    assert not spec.names.find("m").structural


def test_the_axis_of_the_intervals_may_be_the_only_span():
    text = PD + "kp = { start = 0, stop = 10 }\nkd = [1, 2]\n"
    assert sweep_axes(load(tomllib.loads(text)))[0].name == "kp"
    with pytest.raises(SpecError, match="the number whose stable intervals are wanted"):
        sweep_axes(load(tomllib.loads(PD)))


def test_the_stiffness_of_the_wall_is_k_ve():
    axis, others = sweep_axes(load(tomllib.loads(WALL)), "K_VE")
    assert (axis.name, axis.start, axis.stop, [other.name for other in others]) == ("K", 0.0, 20000.0, ["B"])
    with pytest.raises(SpecError, match="the numbers of a wall"):
        sweep_axes(load(tomllib.loads(PD)), "K_VE")


SOURCE = "the output of a block, a number, or a signal from outside that [ports] names"
LINEAR = "arithmetic that is linear in the signals"
TYPES = "one of " + ", ".join(f'"{name}"' for name in BLOCKS)


@pytest.mark.parametrize(
    ("changes", "place", "expected", "found"),
    [
        (
            [("every = 20", "evry = 20"), ("phase = 10\n", "")],
            "17:1: block.net.evry",
            "one of type, steps, seconds, every, phase",
            "an unknown key; did you mean `every`?",
        ),
        ([('"delay"', '"dely"')], "16:8: block.net.type", TYPES, '"dely"; did you mean `delay`?'),
        ([('type = "delay"\n', "")], "15:2: block.net.type", TYPES, "nothing (it has no default)"),
        ([("mass = 0.2\n", "")], "10:2: block.arm.mass", "a number > 0", "nothing (it has no default)"),
        ([("mass = 0.2", "mass = -1")], "12:8: block.arm.mass", "a number, or an expression, > 0", "-1"),
        ([("damping = 0.063", "damping = true")], "13:11: block.arm.damping", "a number, or an expression", "true"),
        ([('"arm.x" }', '"arm.x", turns = "yes" }')], "25:58: ports.hand.turns", "true or false", '"yes"'),
        ([("mass = 0.2", "mass = []")], "12:8: block.arm.mass", "a number, or an expression, > 0", "an empty list"),
        ([("mass = 0.2", 'mass = "kd - 3"')], "12:8: block.arm.mass", "a number > 0", '"kd - 3": 0'),
        (
            [("mass = 0.2", 'mass = "1/(kd - 3)"')],
            "12:8: block.arm.mass",
            "a finite number",
            '"1/(kd - 3)": a division by zero, a root or logarithm of a negative number or an overflow',
        ),
        (
            [("mass = 0.2", 'mass = "2*arm.x"')],
            "12:11: block.arm.mass",
            "the name of a number in [numbers]",
            'an unknown name "arm.x"',
        ),
        ([("phase = 10", "phase = 20")], "18:9: block.net.phase", "a whole number < every = 20", "20"),
        (
            [("damping = 0.063", "every = 2")],
            "13:9: block.arm.every",
            "1, since a mass that is continuous runs in every tick",
            "2",
        ),
        ([("c*arm.v", "c*amr.v")], "22:37: wire.arm.f", SOURCE, 'an unknown name "amr.v"; did you mean `arm.v`?'),
        ([("kd*arm.v", "kd*arm.v*net.y")], "22:32: wire.arm.f", LINEAR, "the product of the signals arm.v and net.y"),
        ([("+ hand", "+ hand +")], "22:51: wire.arm.f", "a number, a name or a parenthesis", "the end"),
        ([("+ hand", "+ hand + 2*kp")], "22:53: wire.arm.f", "a sum of signals times numbers", "a term without a signal"),
        (
            [('"net.u" = "arm.x"\n', "")],
            "15:2: block.net.u",
            'a wire to this input, "net.u" = "..." in [wire]',
            "none (0 leaves it at rest)",
        ),
        (
            [('"net.u" = "arm.x"', '"net.u" = "arm.x"\n"net.y" = "arm.x"')],
            "22:1: wire.net.y",
            "one of arm.f, net.u",
            "an output of a block; did you mean `net.u`?",
        ),
        ([('"net.u" = "arm.x"', '"net.u" = true')], "21:11: wire.net.u", "an expression in quotes", "true"),
        ([("kd = 3.0", "kd = 3.0\nq = 1.0")], "8:1: numbers.q", "a number that an expression reads", "one that nothing reads"),
        ([("kd = 3.0", "kd = nan")], "7:6: numbers.kd", "a finite number", "nan"),
        ([("value = 0.0, ", "")], "8:1: numbers.c", "a number, or { value, unit, description }", "no value"),
        (
            [("unit", "units")],
            "8:21: numbers.c.units",
            "one of value, unit, description",
            "an unknown key; did you mean `unit`?",
        ),
        (
            [("tick_hz = 10000", "fast_hz = 10000\ntick_hz = 1")],
            "3:1: rates.fast_hz",
            "tick_hz, the rate that all others divide",
            "an unknown key; did you mean `rates.tick_hz`?",
        ),
        ([("tick_hz = 10000", "tick_hz = -1")], "3:11: rates.tick_hz", "a number, or an expression, > 0", "-1"),
        ([("tick_hz = 10000", "")], "2:2: rates.tick_hz", "a number > 0", "nothing (it has no default)"),
        (
            [("[sweep]", "[device]\nmass = 1\n[sweep]")],
            "27:2: device",
            f"one of the tables {', '.join(KNOWN)}",
            "an unknown table",
        ),
        ([("[sweep]", '[controller]\nkind = "pmw"\n[sweep]')], "27:2: controller", "either a controller or blocks", "both"),
        (
            [("[sweep]", "[sweep]\nq = [1]")],
            "28:1: sweep.q",
            "along, require, one of kp, kd, c or the path of a number in a block",
            "an unknown axis",
        ),
        ([('along = "c"', 'along = "arm"')], "28:9: sweep.along", "the name of a numeric key", '"arm"'),
        (
            [('displacement = "arm.x"', 'displacement = "arm.y"')],
            "25:42: ports.hand.displacement",
            "an output of arm: arm.v or arm.x",
            'an unknown name "arm.y"; did you mean `net.y`?',
        ),
        ([(', displacement = "arm.x"', "")], "25:1: ports.hand", "both force and displacement", "no displacement"),
        ([("+ hand", "")], "25:18: ports.hand.force", "a signal that a wire reads", '"hand", which none reads'),
        (
            [('displacement = "arm.x"', 'displacement = "arm.x - kd*net.y"')],
            "25:41: ports.hand.displacement",
            OF_PLANT,
            '"arm.x - kd*net.y": net.y changes every 20 ticks only',
        ),
        ([('"arm.x"', '"arm.v"')], "25:41: ports.hand.displacement", OF_PLANT, '"arm.v": arm.v is a velocity'),
        (
            [('displacement = "arm.x"', 'displacement = "arm.x + hand"')],
            "25:41: ports.hand.displacement",
            OF_PLANT,
            '"arm.x + hand": the force itself',
        ),
        (
            [("[sweep]", "[bode]\nfrequency_hz = [1, 6000]\n[sweep]")],
            "28:16: bode.frequency_hz",
            "numbers <= 5000 (half of rates.tick_hz)",
            "6000",
        ),
    ],
)
def test_each_mistake_is_one_line_with_its_place(changes, place, expected, found, write):
    assert mistakes(write(changed(ARM, *changes))) == [f"a.toml:{place}: expected {expected}, found {found}"]


def test_mistakes_come_all_at_once_and_a_broken_block_brings_no_others(write):
    text = changed(ARM, ('"mass"', '"mas"'), ("every = 20", "every = 0.5"), ("c  = { start = -1, stop = 20 }", "d  = [1]"))
    places = [line.split(": ")[:2] for line in mistakes(write(text), "kq=1")]
    assert places == [
        ["a.toml:11:8", "block.arm.type"],
        ["a.toml:17:9", "block.net.every"],
        ["a.toml:29:1", "sweep.d"],
        ["--set kq=1", "kq"],
    ]


@pytest.mark.parametrize(
    ("axis", "found"),
    [
        ("kp = [60, 0, 240]", "0"),
        ("kp = { start = -1, stop = 1, num = 5 }", "0"),
        ("kp = { start = -1, stop = 240 }", "0 between -1 and 240"),
        ("kp = { start = 0, stop = 240 }", "0 between 0 and 240"),
    ],
)
def test_a_first_coefficient_that_becomes_0_is_a_mistake_of_the_axis(axis, found, write):
    """kp*s + kd is no polynomial of degree 1 for kp = 0."""
    filtered = 'type = "tf"\nnum = [1]\nden = ["kp", "kd"]'
    text = changed(
        ARM, ('type = "delay"\nevery = 20\nphase = 10', filtered), ("-kp*net.y", "-net.y"), ("kp = [60, 120, 240]", axis)
    )
    expected = "values with which the first coefficient of block.net.den is not 0"
    assert mistakes(write(text)) == [f"a.toml:30:1: sweep.kp: expected {expected}, found one with which it is {found}"]
    load(write(text.replace(axis, axis.replace("-1", "0.5").replace(" 0,", " 9,"))))


@pytest.mark.parametrize(
    ("kind", "given", "right"),
    [
        ("mass", {"m": 0.1}, "mass"),
        ("mass", {"inertia": 0.1}, "mass"),
        ("inertia", {"mass": 0.1}, "inertia"),
        ("inertia", {"J": 0.1}, "inertia"),
        ("mass", {"mass": 0.1, "d": 1.0}, "damping"),
        ("mass", {"mass": 0.1, "c": 1.0}, "damping"),
        ("mass", {"mass": 0.1, "k": 1.0}, "stiffness"),
        ("spring", {"stiffness": 1.0}, "k"),
        ("spring", {"k": 1.0, "damping": 1.0}, "d"),
    ],
)
def test_the_key_of_another_type_of_block_is_named_with_the_right_one(kind, given, right):
    """As the only mistake: neither the key in its place is missing, nor a number in it unread."""
    named = dict.fromkeys(given, "p")
    tables = {"rates": {"tick_hz": 100}, "numbers": {"p": 1.0}, "block": {"arm": {"type": kind} | named}}
    (line,) = mistakes(tables | {"wire": {"arm.x1" if kind == "spring" else "arm.f": "0"}})
    assert line.startswith(f"block.arm.{list(given)[-1]}: ")
    assert line.endswith(f"did you mean `{right}`?")


def test_a_misspelt_number_is_one_mistake(write):
    (line,) = mistakes(write(changed(ARM, ("-kp*net.y", "-kpp*net.y"))))
    assert line.endswith("did you mean `kp`?")


def test_a_number_that_there_is_not_is_refused_with_those_that_there_are(write):
    (line,) = mistakes(write(ARM), "kq=1")
    assert line.startswith("--set kq=1: kq: expected kp, kd, c of [numbers], or one of the tables ")


def test_a_block_with_a_mistake_misses_its_wires_too(write):
    text = changed(ARM, ("every = 20", "every = 0.5"), ('"net.u" = "arm.x"\n', ""))
    keys = [line.split(": ")[1] for line in mistakes(write(text))]
    assert keys == ["block.net.u", "block.net.every"]


def test_a_wire_may_read_what_the_hand_s_position_may_not_be_made_of():
    """With a factor of 0 a held signal has no part in the displacement."""
    load(tomllib.loads(changed(ARM, ('displacement = "arm.x"', 'displacement = "arm.x + 0*net.y"'))))


def test_two_wires_to_one_input_are_one_too_many(write):
    twice = changed(ARM, ('"net.u" = "arm.x"', '"net.u" = "arm.x"\nnet.u = "arm.x"'))
    assert mistakes(write(twice)) == ["a.toml:22:1: wire.net.u: expected each key once, found the same key again"]
    assert (
        'each key once, found "net.u" a second time'
        in mistakes(write(changed(ARM, ('"net.u" = "arm.x"', '"net.u" = "arm.x"\n"net.u" = "0"'))))[0]
    )


def test_a_frame_of_too_many_ticks_is_refused_with_its_rates(write):
    text = changed(ARM, ("every = 20", 'every = 20\n[block.a]\ntype = "hold"\nevery = 9973'), ("phase = 10\n", "phase = 1\n"))
    text = changed(text, ('"net.u" = "arm.x"', '"net.u" = "arm.x"\n"a.u" = "arm.x"'))
    (line,) = mistakes(write(text))
    assert line.endswith("<= 100000, found 199460 (the least common multiple of 1, 20, 9973)")
    assert LONGEST_FRAME == 100_000


@pytest.mark.parametrize(
    ("keys", "key", "found"),
    [
        ('type = "ss"\nA = [[0, 1]]\nB = [[1]]\nC = [[1]]', "A", "1 of 2"),
        ('type = "ss"\nD = [[1, 2]]', "D", "1 of 2"),
        ('type = "ss"\nA = [1]', "A", "a list"),
        ('type = "ss"\nD = [[1]]\ninputs = ["u", "u"]', "inputs", "u, u"),
        ('type = "tf"\nnum = [1, 2]\nden = [1]', "num", "2"),
        ('type = "tf"\nnum = [1]\nden = [0, 1]', "den", "0"),
        ('type = "tf"\nnum = [1]\nden = []', "den", "an empty list"),
        ('type = "butterworth"\norder = 2\ncutoff_hz = 250\nevery = 20', "cutoff_hz", "250"),
        ('type = "butterworth"\norder = 2.5\ncutoff_hz = 25', "order", "2.5"),
        ('type = "butterworth"\norder = 2\ncutoff_hz = 25\npass = "hihg"', "pass", '"hihg"'),
        ('type = "delay"\nsteps = -1', "steps", "-1"),
        ('type = "tf"\nnum = [1]\nden = [1, 1]\ndiscrete = 1', "discrete", "1"),
    ],
)
def test_shapes_and_ranges_of_keys_are_checked(keys, key, found, write):
    text = changed(ARM, ("[wire]", f'[block.extra]\n{keys}\n[wire]\n"extra.u" = 0'))
    (line,) = mistakes(write(text))
    assert f"block.extra.{key}: expected " in line
    assert f"found {found}" in line


def test_names_of_numbers_are_no_names_of_columns_and_no_words_of_expressions():
    assert {
        field.name for kind in ("zwidth", "bode", "passivity") for field in kind_named(kind).fields if not field.derived
    } <= COLUMNS
    for name in ("low", "pi", "frequency_hz", "a-b"):
        tables = tomllib.loads(PD)
        tables["numbers"][name] = 1.0
        assert any(line.startswith(f"numbers.{name}: expected a name") for line in mistakes(tables))


@pytest.mark.parametrize("word", ["nan", "inf", "None", "NaN", "true", "NA"])
def test_what_other_programs_take_for_a_value_is_no_name(word, write):
    expected = "a name of letters, digits and _ that is no value, as nan, inf, none, null, na, true and false are"
    number = changed(ARM, ("kd*", f"{word}*"), ("kd = ", f"{word} = "))
    more = ", and neither pi nor a function"
    assert mistakes(write(number)) == [f'a.toml:7:1: numbers.{word}: expected {expected}{more}, found "{word}"']
    block = changed(ARM, ("net.", f"{word}."), ("[block.net]", f"[block.{word}]"))
    assert mistakes(write(block)) == [f'a.toml:15:2: block.{word}: expected {expected}, found "{word}"']
    force = changed(ARM, ("+ hand", f"+ {word}"), ('"hand"', f'"{word}"'))
    of_force = f"{expected}, for the hand's force"
    assert mistakes(write(force)) == [f'a.toml:25:18: ports.hand.force: expected {of_force}, found "{word}"']


def test_a_spec_s_file_has_no_such_name_either(tmp_path):
    path = tmp_path / "NaN.toml"
    path.write_text('[controller]\nkind = "pmw"\n')
    with pytest.raises(UsageError, match=r'file name: expected a name that is no value, .*, found "NaN"; rename the file'):
        load(path)


def test_the_hand_of_a_drawn_loop_is_simulated(write):
    spec = load(write(ARM + "[simulate]\ninput = 'step'\nduration_s = 0.5\n"))
    assert "simulate" not in spec.tables()
    simulated = spec.as_simulated()
    tables = simulated.tables()
    assert (tables["simulate"]["input"], tables["simulate"]["duration_s"]) == ("step", 0.5)
    assert tables["simulate"]["friction"] == 0.0
    assert load(simulated.tables()).as_simulated().sha256 == simulated.sha256


def test_a_simulation_fits_the_tick_and_needs_something_from_outside(write):
    (line,) = mistakes(write(ARM + "[simulate]\nfrequency_hz = 5000\n"))
    assert line == "a.toml:32:16: simulate.frequency_hz: expected numbers < 5000.0 (half of rates.tick_hz), found 5000.0"
    with pytest.raises(SpecError, match=r"ports: expected inputs = .*, or hand = .*, found neither"):
        load(write(NETWORK)).as_simulated()


def test_a_spec_with_a_controller_is_no_drawing():
    spec = load(nested({"controller.kind": "pmw"}))
    assert (spec.drawing, spec.kind) == (None, "pmw")


def test_an_unknown_axis_is_one_mistake_and_its_numbers_are_offered():
    tables = tomllib.loads(PD) | {"sweep": {"kq": {"start": 0, "stop": 200}}}
    with pytest.raises(SpecError) as refused:
        load(tables)
    (mistake,) = refused.value.mistakes
    assert mistake.expected.startswith("along, require, one of ")
    assert mistake.expected.endswith(" or the path of a number in a block")


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


def test_a_key_that_has_its_default_is_an_axis_too():
    tables = tomllib.loads(ARM)
    tables["sweep"]["block.arm.stiffness"] = [0, 10]
    assert load(tables).values["block.arm.stiffness"] == 0.0


@pytest.mark.parametrize(
    "axis", ["block.arm.mas", "block.arm.type", "block.other.mass", "block.arm", "block", "block.arm.damping"]
)
def test_what_is_no_number_in_a_block_is_no_axis(axis):
    tables = tomllib.loads(ARM)
    tables["sweep"][axis] = [1, 2]
    tables["block"]["arm"]["damping"] = "kd"
    with pytest.raises(SpecError) as refused:
        load(tables)
    assert [(mistake.key, mistake.found) for mistake in refused.value.mistakes] == [(f"sweep.{axis}", "an unknown axis")]


def test_a_rate_in_quotes_is_an_expression_that_no_axis_changes():
    tables = tomllib.loads(ARM)
    tables["rates"]["tick_hz"] = "10000"
    spec = load(tables)
    assert spec.tick_hz == 10000.0
    assert spec.names.find("rates.tick_hz") is None
    assert wavesweep.compile(tables).stable_intervals(span=(0, 20), kp=[60.0]).certified.all()


AXIS = "along, require, one of kp, kd, mass, c or the path of a number in a block"
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
    values = {s: value_of(gain, {"kp": 7, "kd": 3, "c": 2, "mass": 1}) for s, gain in named}
    assert values == {"net.y": -7, "arm.v": -1, "hand": 1}
    assert [signal for signal, _ in plain] == [signal for signal, _ in named]
    assert load(spec.tables()).sha256 == spec.sha256


@pytest.mark.parametrize(
    ("changes", "place", "expected", "found"),
    [
        (
            [("1*mass", "1*w")],
            "8:5: numbers.w",
            "an expression whose names do not stand for each other in a circle",
            '"sqrt(kp/m)"',
        ),
        (
            [("1*mass", "1*mess")],
            "9:8: numbers.m",
            "the name of a number in [numbers]",
            'an unknown name "mess"; did you mean `mass`?',
        ),
        (
            [('"arm.v"\nb', '"braking"\nb')],
            "25:9: signals.speed",
            "an expression whose names do not stand for each other in a circle",
            '"braking"',
        ),
        ([("c  = { start", "m  = { start")], "38:8: sweep.m", AXIS, "a number that follows from others"),
        (
            [('along = "c"', 'along = "m"')],
            "37:9: sweep.along",
            "the name of a numeric key",
            '"m", which follows from other numbers',
        ),
        ([("w*slow", "w*slow*slow")], "26:29: signals.braking", LINEAR, "the product of the signals net.y and net.y"),
        ([("+ w*slow", "")], "27:1: signals.slow", "a signal that an expression reads", "one that nothing reads"),
        ([("slow", "mass")], "27:1: signals.mass", f"{NAME}, and no number, function or signal from outside either", '"mass"'),
        ([('"0*net.y"', "0")], "27:8: signals.slow", "an expression in quotes", "0"),
        (
            [('"arm.v"\nb', '"arm.pos"\nb')],
            "25:10: signals.speed",
            "an output of arm: arm.v or arm.x",
            'an unknown name "arm.pos"; did you mean `arm.x`?',
        ),
    ],
)
def test_each_mistake_of_what_names_stand_for_is_one_line(changes, place, expected, found, write):
    lines = mistakes(write(changed(changed(ARM, *DERIVED), *changes)))
    assert f"a.toml:{place}: expected {expected}, found {found}" in lines
    assert len(lines) <= 3  # of a circle each name, and what is not read any more


def test_names_that_stand_for_ever_more_are_refused(write):
    chain = "\n".join(f'w{i} = "{"+".join([f"w{i - 1}"] * 9)}"' for i in range(1, 9))
    text = changed(ARM, ("kd = 3.0", f"kd = 3.0\nw0 = 1\n{chain}"), ("c*arm.v", "w8*c*arm.v"))
    assert "at most 2000 parts, 200 within each other, with those of its names, found more" in mistakes(write(text))[0]


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
