"""What the program refuses the checker refuses: two keys of one number, values that no key takes, tables that say nothing."""

import re

import pytest
from checker.test_hand_made import SPEC as TURN
from support.proofs import checked

import wavesweep
from wavesweep.checker import balls, file
from wavesweep.checker.reader import for_all
from wavesweep.engine.drawing import TYPES, keys_of_block
from wavesweep.program.reading.keys import KEYS

pytestmark = pytest.mark.asks("for_all", "designs", "simulation")  # whose tables are read as well

KIND = 'controller.kind = "pmw"\nenvironment.step = "elapsed"\n'
EDGES = "passband_hz = 10, stopband_hz = 100, passband_db = 1, stopband_db = 20"
RATIOS = '"rates.ratio" = { values = [16, 20], varying = true'
DRAWN = """
rates.tick_hz = 100
numbers = {{ m = 1.0, k = 50.0 }}
[block]
x = {{ type = "mass", mass = "m", damping = 6.0 }}
c = {{ type = "{}" }}
[wire]
"c.u" = "-k*x.x"
"x.f" = "c.y"
"""
ONE_NUMBER = [
    "rates.ratio = 20\nrates.slow_hz = 50", f"filters.lp1 = {{ {EDGES}, order = 5 }}", f"filters.hp = {{ {EDGES} }}",
    f"filters.lp1 = {{ {EDGES}, cutoff_hz = 20 }}", "filters.lp2.passband_hz = 5",
    '[sweep]\nb = [1, 2]\n"controller.b" = [3]', '[sweep]\n"rates.ratio" = [10]\n"rates.slow_hz" = [50]',
    "[sweep]\nb = [1, 2]\n[for_all]\nb = [3, 4]", '[sweep]\nb = [1, 2]\n[for_all]\n"controller.b" = [3, 4]',
    '[sweep]\n"rates.slow_hz" = [50]\n[for_all]\n"rates.ratio" = [10, 20]', '[bode]\nb = [1]\n[for_all]\n"controller.b" = [3]',
    '[for_all]\nb = { start = 11, stop = 13 }\n"controller.b" = { start = 50, stop = 80 }',
    '[for_all]\ndevice.mass = [1, 2]\n"device.mass" = [3]', '[for_all]\n"rates.slow_hz" = [50]',
    f'filters.lp1 = {{ {EDGES} }}\n[for_all]\n"filters.lp1.order" = [1, 2]',
    'rates.slow_hz = 50\n[for_all]\n"rates.fast_hz" = [500, 1000]',
    '[sweep]\ndevice.mass = [1, 2]\n"device.mass" = { start = 1, stop = 2 }',
]  # fmt: skip
NO_VALUE = [
    "environment.delay = 21", "rates.slow_hz = 60\nenvironment.delay = 18", "local_model.delay = 5", "controller.b = '25'",
    "filters.lp1.cutoff_hz = 500", "filters.lp1.order = 13", f"filters.lp1 = {{ {EDGES.replace('= 20', '= 0.5')} }}",
    "device.dead_time = 1.001", "rates.slow_hz = 600", "rates.slow_hz = 0.5",
    '[for_all]\n"rates.ratio" = []', '[for_all]\n"filters.lp1.order" = { start = 3, stop = 1 }',
    '[for_all]\n"environment.delay" = [1, 21, 41]', "[for_all]\nb = { start = 3, stop = 1 }", "[for_all]\nb = { start = 1 }",
    "[for_all]\nb = { start = 1, stop = 2, values = [1] }", "[for_all]\nb = [1, 1]", "[for_all]\nb = [-1, 1]",
    "[for_all]\nb = { values = [1, 2], shares = [1, 1] }", "[for_all]\nlost = 17", "[for_all]\nlost = 0.5",
    "[for_all]\nloss = 1.5", "[for_all]\nlost = 1\nloss = 0.5", "[for_all]\ncontact = 1", "[for_all]\ntick = { late = 11 }",
    "[for_all]\ntick = {}",
    "[for_all]\ncontact = true\nb = { start = 1, stop = 2 }", "[for_all]\ntick = { late = 0.0001 }\nlost = 1",
    '[for_all]\n"rates.ratio" = { start = 10, stop = 100, varying = true }', f"[for_all]\n{RATIOS}, shares = [1] }}",
    f"[for_all]\n{RATIOS}, shares = [0, 0] }}", f"[for_all]\n{RATIOS}, next = [[1, 1]] }}",
    f"[for_all]\n{RATIOS}, shares = [1, 1], next = [[1, 0], [0, 1]] }}", f"[for_all]\n{RATIOS}, shares = [1, 1] }}\nlost = 1",
    f'[for_all]\n{RATIOS}, shares = [1, 1] }}\n"environment.delay" = {{ values = [1, 8], varying = true }}',
    f'[for_all]\n{RATIOS} }}\n"environment.delay" = {{ values = [1, 8], varying = true, next = [[1, 0], [0, 1]] }}',
    f"[for_all]\n{RATIOS}, hold = 1 }}", '[for_all]\n"rates.ratio" = { start = 4.5, stop = 6, varying = true }',
    '[for_all]\n"device.mass" = { values = [0.1, 0.2], varying = true }', '[for_all]\n"device.mass" = 0.1',
    "[sweep]\nfoo = [1]", "[sweep]\nK_VE = [-1]", "[sweep]\nK_VE = { start = 5, stop = 1 }",
]  # fmt: skip
TAKEN = [
    "rates.slow_hz = 1000", "rates.slow_hz = 1",
    "rates.slow_hz = 60\nenvironment.delay = 17", f"filters.lp1 = {{ {EDGES} }}", "filters.lp2.cutoff_hz = 600",
    "filters.lp1 = { order = 0, cutoff_hz = 600 }", 'rates.slow_hz = 50\n[sweep]\n"rates.ratio" = [10, 20]',
    "[sweep]\nb = [1, 2]\n[bode]\nb = [1]", "[for_all]\nb = { start = 2, stop = 2 }", "[for_all]\ndevice.mass = [1, 2]",
    "rates.slow_hz = 50\n[for_all]\n" + RATIOS + " }", "[for_all]\ntick = { late = 0.0001 }\ncontact = false",
    '[sweep]\n"filters.lp2.cutoff_hz" = [400, 600]',
]  # fmt: skip
DRAWINGS = {
    "a number by its path": '[for_all]\n"numbers.m" = { start = 0.1, stop = 0.2 }\nm = { start = 5, stop = 6 }',
    "a number of another table": "[sweep]\nk = [1]\n[for_all]\n'numbers.k' = [2, 3]",
    "no rising numbers": "[for_all]\nm = { start = 0.2, stop = 0.1 }",
    "a result that is lost": "[for_all]\nlost = 1",
    "a key of no range": "[sweep]\n'block.x.damping' = [nan]",
    "a port of two names": "[ports]\nhand.force = 'push'",
    "a hand that turns and has volts": "[ports]\nhand = { force = 'f', displacement = 'x.x', turns = true, volts = true }",
    "a hand that has volts as a number": "[ports]\nhand = { force = 'f', displacement = 'x.x', volts = 1 }",
    "a reaction in a list": "[ports]\nhand = { force = 'f', displacement = 'x.x', reaction = ['c.y'] }",
    "a force that no wire reads": "[ports]\nenvironment = { force = 'f', displacement = 'x.x' }",
    "an input that no wire reads": "[ports]\ninputs.f = 'f'",
    "a unit that is a number": "[ports]\noutputs.x = { signal = 'x.x', unit = 3 }",
    "a wall of one number": "[ports]\nwall = { stiffness = 'k', damping = 'k' }",
    "a tick longer than 10,000 own ones": "[for_all]\ntick = { late = 100.0 }",
}


def refused(text: str) -> tuple[str, str]:
    """Why the program and the checker refuse a spec, empty if they take it: its own loop and all members of [for_all]."""
    theirs = ours = ""
    try:
        tables = file.spec_of(text.encode())
        file.family_of(tables, file.Claim("modes"))
        allowed = for_all.read(tables, balls.exact)
        for member in allowed.members:
            file.family_of(tables, file.Claim("modes", dict.fromkeys(allowed.ranges, balls.exact(1)) | member))
    except (file.Unreadable, file.Refused) as error:
        ours = str(error)
    try:
        wavesweep.load(file.tomllib.loads(text))
    except wavesweep.SpecError as error:
        theirs = str(error)
    return theirs, ours


SAID = re.compile(r"(?!the spec cannot be read: [A-Z]).+")  # and not that of an error in the program


@pytest.mark.parametrize("text", ONE_NUMBER + NO_VALUE)
def test_a_controller_that_the_program_refuses_is_refused(text, tmp_path):
    theirs, _ = refused(KIND + text)
    assert theirs
    code, words = checked(tmp_path, KIND + text, [{"claim": "modes", "outside": 0, "states": []}])
    if code == 1:  # what a member alone has
        code, words = checked(tmp_path, KIND + text, [{"claim": "for all", "states": []}])
    assert (code, words.count("\n"), "cannot be read: " in words) == (2, 1, False), words


@pytest.mark.parametrize(
    "own", ["controller.b = 'x'\n[for_all]\nb = [3, 4]", 'rates.slow_hz = 1.62\n[for_all]\n"rates.ratio" = [15, 17]']
)
def test_a_number_of_the_spec_is_read_where_a_claim_has_others(own):
    theirs, _ = refused(KIND + own)
    assert theirs
    with pytest.raises(file.Unreadable):
        file.spec_of((KIND + own).encode())


@pytest.mark.parametrize("text", TAKEN)
def test_a_controller_that_the_program_takes_is_taken(text):
    assert refused(KIND + text) == ("", "")


@pytest.mark.parametrize("case", DRAWINGS)
def test_a_drawing_that_the_program_refuses_is_refused(case):
    theirs, ours = refused(DRAWN.format("hold") + DRAWINGS[case])
    assert theirs
    assert SAID.match(ours), ours


@pytest.mark.parametrize(
    ("own", "more"),
    [
        ('{ type = "hold" }', "[for_all]\ntick = { late = 20.0 }\n"),
        ('{ type = "channel", late = 1, loss = 0.0 }', ""),
        ('{ type = "channel", late = 1, burst = "0" }', ""),
    ],
)
def test_a_drawing_that_the_program_takes_is_taken(own, more, tmp_path):
    """A loop of 0.1 Hz, whose ticks may last longer than 10 s, and messages that are lost with the probability 0."""
    spec = DRAWN.format("hold").replace("tick_hz = 100", "tick_hz = 0.1").replace('{ type = "hold" }', own) + more
    assert refused(spec) == ("", "")
    code, words = checked(tmp_path, spec, [{"claim": "for all", "states": []}])
    assert (code, "the states are" in words) == (1, True), words


@pytest.mark.parametrize("name", ["contact", "tick", "lost", "loss", "shares", "next", "late", "values", "lambda"])
def test_a_number_may_have_the_name_of_a_key(name, tmp_path):
    """Its line of [for_all] is a range, which a claim has as a side, and no key of the table."""
    spec = DRAWN.format("hold").replace('"m"', f'"{name}"').replace("m =", f"{name} =")
    spec += f"[for_all]\n{name} = {{ start = 0.5, stop = 1 }}\n"
    assert refused(spec) == ("", "")
    claim = {"claim": "for all", "states": ["@c", "@x"]}
    code, words = checked(tmp_path, spec, [claim])
    assert (code, "the sides are not the ranges of [for_all]" in words) == (1, True), words
    code, words = checked(tmp_path, spec, [claim | {"sides": {name: ["0.5", "1"]}}])
    assert (code, f"{name} from 0.5 to 1" in words and "the states are" in words) == (1, True), words


@pytest.mark.parametrize(("name", "ranges"), [("block", "block.c.phase = [0]"), ("numbers", "numbers.numbers = [2, 3]")])
def test_a_number_may_have_the_name_of_a_table(name, ranges):
    spec = DRAWN.format("hold").replace("k =", f"{name} =").replace("-k*", f"-{name}*")
    assert refused(f"{spec}[for_all]\n{ranges}") == ("", "")


@pytest.mark.parametrize(("name", "taken"), [("s_k", True), ("numbers.s_k", True), ("block.s.k", False)])
def test_a_number_of_a_class_has_a_range(name, taken):
    spec = (
        DRAWN.format("hold")
        .replace("-k*x.x", "s.y")
        .replace(", k = 50.0", "")
        .replace("[wire]", 's.type = "law"\n[wire]\n"s.u" = "x.x"')
    )
    spec += """[type.law]
numbers.k = 50.0
block.a = { type = "gain", k = "-k" }
wire."a.u" = "u"
ports = { inputs = ["u"], outputs.y = "a.y" }
"""
    theirs, ours = refused(f"{spec}[for_all]\n{name} = {{ start = 40, stop = 60 }}")
    assert (not theirs, not ours) == (taken, taken)


def test_frames_that_vary_beside_rates_that_do_not_divide_are_refused():
    text = f"{KIND}rates.slow_hz = 144\n[for_all]\n{RATIOS} }}"
    with pytest.raises(file.Unreadable, match="do not last whole ticks"):
        file.family_of(file.spec_of(text.encode()), file.Claim("for all"))


def test_messages_that_are_never_lost_ask_for_nothing():
    spec = DRAWN.format("hold") + "[for_all]\nloss = 0.0"
    assert refused(spec) == ("", "")
    assert not for_all.read(file.spec_of(spec.encode()), balls.exact).asked


def outside(key) -> list:
    """Values that a key does not take."""
    if key.choices and not key.numeric:
        return ["none of these", 1]
    if not key.numeric:
        return []
    wrong = ["x", True, 1e61, 1e-61]
    wrong += [] if key.low is None else [key.low if key.above_low else key.low - 1]
    wrong += [] if key.high is None else [key.high + 1]
    return wrong + [0.5] * (key.type == "integer")


def written(value) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


@pytest.mark.parametrize("path", [path for path, key in KEYS.items() if outside(key)])
def test_no_key_of_a_controller_takes_a_value_outside_of_its_range(path):
    for value in outside(KEYS[path]):
        text = f'controller.kind = "pmw-lm"\n{path} = {written(value)}\n'
        text = text.removeprefix('controller.kind = "pmw-lm"\n' * (path == "controller.kind"))
        theirs, ours = refused(text)
        assert theirs, text
        assert path in ours, (text, ours)


NEEDED = {
    "mass": "mass = 1", "inertia": "inertia = 1", "spring": "k = 1", "saturation": "high = 1", "lowpass": "a = 0.5",
    "butterworth": "order = 1\ncutoff_hz = 10", "pi": "kp = 1", "pid": "kp = 1", "lead": "zero_hz = 10\npole_hz = 20",
    "notch": "frequency_hz = 10\nq = 1", "mean": "n = 2", "wave": "b = 1", "avatar": "b = 1", "local_model": "b = 1\nK = 1",
    "mass_matrix": "axes = ['x']\nmass = [[1]]", "ss": "A = [[1]]\nB = [[1]]\nC = [[1]]", "tf": "num = [1]\nden = [1, 2]",
    "fir": "coefficients = [1]",
}  # fmt: skip
WIRES = {
    "mass": "f", "inertia": "f", "wave": "v in", "avatar": "in f", "local_model": "in", "mass_matrix": "fx", "spring": "x1 v1",
}  # fmt: skip


@pytest.mark.parametrize("kind", TYPES)
def test_no_key_of_a_block_takes_a_value_outside_of_its_range(kind):
    wires = "\n".join(f"'a.{port}' = '0'" for port in WIRES.get(kind, "u").split())
    lines = NEEDED.get(kind, "").split("\n")
    start = f"rates.tick_hz = 1000\n[wire]\n{wires}\n[block.a]\ntype = '{kind}'\n"
    assert refused(start + "\n".join(lines)) == ("", "")
    for name, key in keys_of_block(kind).items():
        for value in outside(key):
            if kind == "lowpass" and name == "cutoff_hz":
                own = []
            else:
                own = [line for line in lines if not line.startswith(f"{name} =")]
            theirs, ours = refused(start + "\n".join([*own, f"{name} = {written(value)}"]))
            assert theirs, (kind, name, value)
            assert SAID.match(ours), (kind, name, value, ours)


HOLD = 'type = "hold"'
LAST = '"x.f" = "c.y"'
LIMITED = 'type = "pi", kp = 1, high = 1, anti_windup = "back-calculation"'
AXES_OF = 'y = {{ type = "mass_matrix", axes = ["{0}", "{1}"], mass = [[1, 1]] }}\n[wire]\n"y.f{0}" = "0"\n"y.f{1}" = "0"'
SPRING = 's = { type = "spring", k = 1, d = 1 }\n[wire]\n'
TWO_AXES = 'y = {{ type = "mass_matrix", mass = {} }}\n[wire]\n"y.fx" = "0"\n"y.fy" = "0"'
UNFIT = {  # what is written in place of what
    "a port without a wire": ("[wire]", 'y = { type = "mass", mass = 1 }\n[wire]'),
    "a number that nothing reads": ("k = 50.0", "k = 50.0, more = 1.0"),
    "a cutoff above half the rate": (HOLD, 'type = "butterworth", order = 1, cutoff_hz = 50'),
    "a mass that is none": ("[wire]", TWO_AXES.format([[1, 2], [2, 1]])),
    "a mass that is not symmetric": ("[wire]", TWO_AXES.format([[1, 0.2], [0.1, 1]])),
    "limits that do not rise": (HOLD, 'type = "saturation", high = 1, low = 2'),
    "a time constant without back-calculation": (HOLD, 'type = "pi", kp = 1, high = 1, tracking_s = 1'),
    "messages lost at random and in a row": (HOLD, 'type = "channel", loss = 0.1, lost = 1'),
    "a first coefficient of 0": (HOLD, 'type = "tf", num = [1], den = [0, 1]'),
    "two ways to give a delay": (HOLD, 'type = "delay", steps = 1, seconds = 0.1'),
    "a delay that is too long": (HOLD, 'type = "delay", seconds = 10.1'),
    "taps that fall": (HOLD, 'type = "delay", taps = [2, 1]'),
    "matrices that do not fit": (HOLD, 'type = "ss", A = [[1]], C = [[1]]'),
    "a block without an output": ("[wire]", 'y = { type = "ss", inputs = [], outputs = [] }\n[wire]'),
    "an output that there is not": (LAST, LAST + '\n[ports]\noutputs.out = "c.z"'),
    "a key of a port": (LAST, LAST + '\n[ports]\nhand = { force = "push", displacement = "x.x", reacts = "c.y" }'),
    "a table of a number with another key": ("k = 50.0", "k = { value = 50.0, more = 1 }"),
    "a table of a number without a value": ("k = 50.0", 'k = { unit = "N" }'),
    "a filter without an order": (HOLD, 'type = "butterworth", cutoff_hz = 10'),
    "a filter without a cutoff": (HOLD, 'type = "lowpass"'),
    "limits without a high one": (HOLD, 'type = "saturation"'),
    "a way to limit without limits": (HOLD, 'type = "pi", kp = 1, anti_windup = "clamping"'),
    "a low limit without a high one": (HOLD, 'type = "pi", kp = 1, low = -1'),
    "a time constant below the period": (HOLD, f"{LIMITED}, tracking_s = 0.009"),
    "back-calculation without a time constant": (HOLD, LIMITED),
    "a phase that is no tick of the block": (HOLD, 'type = "hold", every = 2, phase = 2'),
    "a constant in a wire": ("-k*x.x", "-k*x.x + 1"),
    "a block without a wire": ('"c.u" = "-k*x.x"\n', ""),
    "matrices of a file that there is not": (HOLD, 'type = "ss", file = "none.npz"'),
    "two ports of one name": (HOLD, 'type = "ss", inputs = ["u", "u"], A = [[1]], B = [[1, 1]], C = [[1]]'),
    "four axes": ("[wire]", "y = { type = 'mass_matrix', axes = ['x', 'y', 'z', 'a'], mass = [[1, 1, 1, 1]] }\n[wire]"),
    "axes of which one is the speed of another": ("[wire]", AXES_OF.format("x", "vx")),
    "a type that there is not": (HOLD, 'type = "nothing"'),
    "more coefficients above than below": (HOLD, 'type = "tf", num = [1, 2], den = [1]'),
    "a spring whose near end is loose": ("[wire]", SPRING + '"s.v1" = "x.v"\n"s.x2" = "0"\n"s.v2" = "0"'),
    "a spring on the ground whose near end is loose": ("[wire]", SPRING + '"s.v1" = "x.v"'),
    "a damped spring that knows no speed": ("[wire]", SPRING + '"s.x1" = "x.x"'),
    "a damped spring that knows one place": ("[wire]", SPRING + '"s.x1" = "x.x"\n"s.v1" = "x.v"\n"s.v2" = "0"'),
    "a name that is none": ("k = 50.0", '"k-" = 1.0, k = 50.0'),
    "a number that is too large": ("k = 50.0", "k = 1e70"),
    "a name that is a word for a value": ("k = 50.0", "nan = 50.0"),
    "a plant of another rate": ("damping = 6.0", "damping = 6.0, every = 2"),
    "a dead time of another rate": (HOLD, 'type = "delay", seconds = 0.01, every = 2'),
    "no coefficients": (HOLD, 'type = "tf", num = [], den = [1, 2]'),
    "numbers that follow from each other": ("k = 50.0", 'k = 50.0, a = "b", b = "a"'),
    **{text: ("-k*x.x", text) for text in (
        "0x10*x.x", "1_0*x.x", "x.x + 2 .y", "foo(1)*x.x", "sqrt()*x.x", "sqrt(**k)*x.x", "sqrt(*k)*x.x", "x.x*x.v", "k/x.x",
        "x.x//2", "x.x**2", "sqrt(x.x)*x.x", "x.x + k", "k(1)*x.x", "prev(x.x)*x.x", "x.x/0", "k**x.x", "x", "x.y", "y.x",
    )},
}  # fmt: skip


@pytest.mark.parametrize("case", UNFIT)
def test_keys_of_blocks_that_do_not_fit_are_refused(case):
    spec = DRAWN.format("hold")
    assert refused(spec) == ("", "")
    theirs, ours = refused(spec.replace(*UNFIT[case]))
    assert theirs
    assert SAID.match(ours), ours


EXACT = """
rates.tick_hz = 1000
block.s = {{ type = "ss", discrete = true, inputs = [], A = [["{}"]], C = [[1]] }}
"""


@pytest.mark.parametrize("number", ["1.00000000000000000001", "0.99999999999999999999", "1.0"])
def test_a_number_in_an_expression_is_the_one_that_stands_there(number, tmp_path):
    """Not the double nearest to it: a mode of 1 + 1e-20 is outside, and no drift."""
    claim = {"claim": "modes", "outside": int(number > "1.0"), "states": ["@s x0"]}
    form = {"L": [["1"]], "signs": "-" if number > "1.0" else "+"}
    code, words = checked(tmp_path, EXACT.format(number), [claim, form])
    assert code == (number == "1.0"), words
    code, words = checked(
        tmp_path, EXACT.format(number), [claim | {"drifts": [["@s x0"]], "states": [], "outside": 0}, {"L": [], "signs": ""}]
    )
    assert code == (number != "1.0"), words


def test_the_ratio_of_a_claim_stands_in_place_of_the_slow_rate(tmp_path):
    spec = 'controller.kind = "dc-slow"\nenvironment.delay = "frame"\nrates.slow_hz = 50\n'
    for ratio, period in (("10", "0.01"), ("20", "0.02")):
        claim = file.Claim("modes", {"rates.ratio": balls.decimal(ratio)})
        schedules, *_ = file.schedules_of(file.spec_of(spec.encode()), claim, {})
        assert schedules[""].period == balls.decimal(period)
    claim = {"claim": "modes", "numbers": {"rates.ratio": "10", "rates.slow_hz": "50"}, "outside": 0, "states": []}
    code, words = checked(tmp_path, spec, [claim])
    assert (code, words) == (2, "not checked: rates.ratio and rates.slow_hz are one number\n")


def test_what_varies_has_no_number_in_what_refutes(tmp_path):
    spec = KIND + f"[for_all]\n{RATIOS} }}\n"
    for numbers in ({"rates.ratio": "20"}, {"rates.slow_hz": "50"}):
        claim = {"claim": "refuted", "numbers": numbers, "outside": 1, "word": ["rates.ratio=20"], "states": []}
        code, words = checked(tmp_path, spec, [claim])
        assert (code, "rates.ratio is set, and varies" in words) == (1, True), words


def test_a_map_has_no_radius(tmp_path):
    claim = {"claim": "modes", "open": True, "radius": "3", "sides": {"k": ["0", "2"]}, "states": ["@turn x0", "@turn x1"]}
    code, words = checked(tmp_path, TURN, [claim, {"L": [["1", "0"], ["0", "1"]], "signs": "++"}])
    assert (code, "without a radius" in words) == (2, True), words


def test_signals_that_double_are_refused_before_they_are_written_out(tmp_path):
    doubled = "\n".join(f's{n} = "s{n - 1} + s{n - 1}"' for n in range(1, 41))
    spec = DRAWN.format("hold").replace("[wire]", f'[signals]\ns0 = "x.x"\n{doubled}\n[wire]').replace("-k*x.x", "-k*s40")
    code, words = checked(tmp_path, spec, [{"claim": "modes", "outside": 0, "states": []}])
    assert (code, "stands for more than" in words) == (2, True), words
    sums = "*".join(["(x.x + 0*x.x)"] + ["(k + k)"] * 30)
    spec = DRAWN.format("hold").replace('"x.f" = "c.y"', f'"x.f" = "c.y - {sums}"')
    code, words = checked(tmp_path, spec, [{"claim": "modes", "outside": 0, "states": []}])
    assert (code, "products" in words) == (2, True), words


TWO_BODIES = """
rates.tick_hz = 200
signals.e = "{}"
[block]
a = {{ type = "mass", mass = 0.5, damping = 1.0 }}
b = {{ type = "mass", mass = 0.3, damping = 0.5 }}
[wire]
"a.f" = "{}"
"b.f" = "-{}"
"""
BOTH = "100*(b.x - a.x) - 30*a.x"


@pytest.mark.parametrize(
    ("meant", "of_a", "of_b", "refuses"),
    [
        (BOTH, "e", "e", True),
        (BOTH, "2*e", "e", True),
        ("100*(b.x - a.x)", "e", "e", False),
        ("30*a.x", "-e", "e", True),
        ("30*a.x", "-e", "30*b.x", False),
    ],
)
def test_a_name_is_held_or_acts_continuously_wherever_it_stands(meant, of_a, of_b, refuses):
    theirs, ours = refused(TWO_BODIES.format(meant, of_a, of_b))
    assert (bool(theirs), bool(ours)) == (refuses, refuses), (theirs, ours)


def test_signals_that_no_block_reads_may_have_numbers():
    spec = DRAWN.format("hold") + "[ports]\noutputs.pull = 'k*x.x'\n[signals]\nturn = 'pi*k*x.x'\n"
    spec = spec.replace('"-k*x.x"', '"-turn"')
    assert refused(spec) == ("", "")
