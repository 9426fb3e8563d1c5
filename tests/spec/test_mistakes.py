"""All mistakes of a spec are said at once, each with place, key, expectation, finding and the nearest right name."""

import math

import pytest

from wavesweep.errors import SpecError
from wavesweep.spec import KEYS, load

KIND = '[controller]\nkind = "pmw"\n'


def mistakes(source, *overrides):
    """Return the lines of the SpecError that loading raises."""
    with pytest.raises(SpecError) as error:
        load(source, overrides)
    return str(error.value).splitlines()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[rates]\nratio = 20.5", "a.toml:4:9: rates.ratio: expected a whole number >= 1, found 20.5"),
        ("[rates]\nratio = 1e400", "a.toml:4:9: rates.ratio: expected a whole number >= 1, found inf"),
        ("[device]\nmass = nan", "a.toml:4:8: device.mass: expected a finite number > 0, found nan"),
        ("[device]\nmass = 2020-01-01", "a.toml:4:8: device.mass: expected a number > 0, found 2020-01-01"),
        ("[device]\nmass = { value = 1 }", "a.toml:4:8: device.mass: expected a number > 0, found a table"),
        ("[device.mass]\nvalue = 1", "a.toml:3:2: device.mass: expected a number > 0, found a table"),
        ("[filters]\nlp1 = 3", "a.toml:4:7: filters.lp1: expected a table, found 3"),
        ("[[device]]\nmass = 1", "a.toml:3:3: device: expected a table, found a list"),
        (
            "[device]\ndampin = 1",
            (
                "a.toml:4:1: device.dampin: expected one of preset, mass, damping, velocity, found an unknown key; "
                "did you mean `device.damping`?"
            ),
        ),
        (
            '[device]\n"mass.x" = 1',
            (
                'a.toml:4:1: device."mass.x": expected one of preset, mass, damping, velocity, found an unknown key; '
                "did you mean `device.mass`?"
            ),
        ),
        (
            '[device]\n"größe" = 1',
            'a.toml:4:1: device."größe": expected one of preset, mass, damping, velocity, found an unknown key',
        ),
        (
            "[environment]\ndelay = 21",
            "a.toml:4:9: environment.delay: expected a whole number <= 20 (rates.ratio), found 21",
        ),
        (
            "[rates]\nfast_hz = 18",
            ("a.toml:1:1: filters.lp1.cutoff_hz: expected a number < 9.0 (half of rates.fast_hz), found 10.0 (the default)"),
        ),
        (
            "[filters]\nlp1.cutoff_hz = 500",
            "a.toml:4:17: filters.lp1.cutoff_hz: expected a number < 500.0 (half of rates.fast_hz), found 500.0",
        ),
        (
            "[rates]\nslow_hz = 50\nratio = 20",
            "a.toml:4:1: rates.slow_hz: expected either ratio or slow_hz, found both",
        ),
        (
            "[rates]\nslow_hz = 700",
            (
                "a.toml:4:11: rates.slow_hz: expected rates.fast_hz = 1000.0 divided by a whole number from 1 to 1000, or by a "
                "fraction of at least 2 after which both are in step again within 100000 ticks "
                "(the nearest: 1000 Hz, ratio = 1 and 500 Hz, ratio = 2), found 700"
            ),
        ),
        (
            "[sweep]\nB_V = [1]",
            (
                "a.toml:4:1: sweep.B_V: expected along, require, one of K_VE, B_VE, K_LM, B_LM, Kp, b "
                "or the path of a numeric key, found an unknown axis; did you mean `B_VE`?"
            ),
        ),
        (
            '[sweep]\n"device.velocity" = ["exact"]',
            (
                "a.toml:4:1: sweep.device.velocity: expected a numeric key, found device.velocity, "
                'which takes one of "exact", "difference"'
            ),
        ),
        (
            '[sweep]\nalong = "device.velocity"',
            ('a.toml:4:9: sweep.along: expected the name of a numeric key, found "device.velocity", which takes no number'),
        ),
    ],
)
def test_each_mistake_is_one_line(text, line, write):
    assert mistakes(write(KIND + text)) == [line]


def test_mistakes_come_all_at_once_in_the_order_of_the_file(write):
    text = KIND + '[devise]\nmass = 1\n[device]\nmass = -1\nvelocity = 3\n[sweep]\nb = [1, "x", -2]\nalong = 4\n'
    places = [line.split(": ")[:2] for line in mistakes(write(text), "environment.delay=21", "kin=1")]
    assert places == [
        ["a.toml:3:2", "devise"],
        ["a.toml:6:8", "device.mass"],
        ["a.toml:7:12", "device.velocity"],
        ["a.toml:9:5", "sweep.b[1]"],
        ["a.toml:9:5", "sweep.b[2]"],
        ["a.toml:10:9", "sweep.along"],
        ["--set kin=1", "kin"],
        ["--set environment.delay=21", "environment.delay"],
    ]


def test_an_unknown_table_is_one_mistake_however_much_is_in_it(write):
    text = KIND + "[devise]\n" + "".join(f"a{i} = {i}\n" for i in range(100)) + "[devise.more]\nb = 1\n"
    assert len(mistakes(write(text))) == 1


def test_a_wrong_value_does_not_bring_mistakes_of_others_with_it(write):
    text = KIND + "[rates]\nfast_hz = 0\nslow_hz = 7\n[filters]\nlp1.cutoff_hz = 1e6\n"
    assert [line.split(": ")[1] for line in mistakes(write(text))] == ["rates.fast_hz"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ('controller = "pmw"', ['a.toml:1:14: controller: expected a table, found "pmw"']),
        (f'design = "x"\n{KIND}', ['a.toml:1:10: design: expected a table, found "x"']),
        (
            'rates = 3\nblock = "x"\n[wire]\n"a.u" = "b.y"',
            [
                "a.toml:1:9: rates: expected a table, found 3",
                'a.toml:2:9: block: expected a table, found "x"',
                "a.toml:4:1: wire.a.u: expected an input port of a block, found an unknown port",
            ],
        ),
    ],
)
def test_what_is_missing_in_a_table_that_is_none_is_no_other_mistake(text, lines, write):
    assert [line for line in mistakes(write(text)) if 'unknown name "b.y"' not in line] == lines
    assert mistakes(write(KIND), "controller=pmw") == ['--set controller=pmw: controller: expected a table, found "pmw"']


def test_deep_and_wide_texts_are_mistakes_not_crashes(write):
    deep = "a" + ".a" * 3000 + " = 1\n"
    assert [line.split(": ")[1] for line in mistakes(write(deep + KIND))] == ["expected at most 64 names in a key, found more"]
    wide = KIND + "[sweep]\nb = [" + "0, " * 1000 + "]\n"
    *listed, rest = mistakes(write(wide))
    assert len(listed) == 20
    assert rest.endswith("so many wrong ones that the 980 values from [20] on were not looked at")


@pytest.mark.parametrize("key", KEYS.values(), ids=lambda key: key.path)
@pytest.mark.parametrize("value", [math.nan, math.inf, 10**400, True, None, [], {}, [1], {"a": 1}, b"1", object()])
def test_hostile_values_are_refused_for_every_key(key, value):
    *parents, last = key.path.split(".")
    tables = {"controller": {"kind": "pmw"}}
    inner = tables
    for parent in parents:
        inner = inner.setdefault(parent, {})
    inner[last] = value
    with pytest.raises(SpecError) as error:
        load(tables)
    assert any(mistake.key in (key.path, ".".join(parents)) for mistake in error.value.mistakes)
    assert all(mistake.location == "" for mistake in error.value.mistakes)


@pytest.mark.parametrize(
    ("tables", "line"),
    [
        ({"controller": 3}, "controller: expected a table, found 3"),
        ({"sweep": []}, "sweep: expected a table, found an empty list"),
        (
            {"bode": {"frequency_hz": 3}},
            "bode.frequency_hz: expected a list of numbers or { start, stop, num }, found 3",
        ),
        ({1: 2}, '"1": expected one of the tables'),
        ({"": 2}, '"": expected one of the tables'),
    ],
)
def test_a_dict_has_mistakes_without_places(tables, line):
    lines = mistakes({"controller": {"kind": "dc"}} | tables)
    assert any(found.startswith(line) for found in lines)


@pytest.mark.parametrize(
    ("frequency", "fast", "said"),
    [(500.0001, 1000.0, "<= 500 (half of rates.fast_hz), found 500.0001"), (50.0, 99.99999999, "<= 49.999999995 (half")],
)
def test_numbers_that_differ_are_shown_apart(frequency, fast, said):
    with pytest.raises(SpecError) as caught:
        load({"controller": {"kind": "pmw"}, "rates": {"fast_hz": fast}, "bode": {"frequency_hz": [1.0, frequency]}})
    assert said in str(caught.value)
