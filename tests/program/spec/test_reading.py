"""Keys and values are found where they stand; strings, comments and nesting do not mislead."""

import tomllib

from wavesweep.program.reading.reading import locate, scan

TEXT = '''\
# [fake] key = 1
top = "[fake]\\" # = " # comment with key = 2
[rates]
fast_hz = 1000.0   # ratio = 3
  ratio   =   20
text = """
[device]
mass = 7 \\""" """
raw = \'\'\'
[device]
mass = 8\'\'\'
[device]
"mass"=1
'vel.ocity' = 'exact'
list = [ 1, "]", [2, # ]
  3], { mass = 4 } ]
[ filters . lp1 ]
order = 1
[filters]
hp = { order = 6, "cutoff_hz" = { deep = 1 }, x = [1, { y = 2 }], last = 1 }
a.b.c = 1979-05-27 07:32:00
[[many]]
one = 1
[[many]]
one = 2
[unicod\u00e9]
'''.replace("[unicod\u00e9]", '["unicod\u00e9"]\n"k\\u00e9y" = 1')

EXPECTED = {
    ("top",): (2, 7),
    ("rates",): (3, 2),
    ("rates", "fast_hz"): (4, 11),
    ("rates", "ratio"): (5, 15),
    ("rates", "text"): (6, 8),
    ("device",): (12, 2),
    ("device", "mass"): (13, 8),
    ("device", "vel.ocity"): (14, 15),
    ("device", "list"): (15, 8),
    ("filters", "lp1"): (17, 3),
    ("filters", "lp1", "order"): (18, 9),
    ("filters", "hp", "order"): (20, 16),
    ("filters", "hp", "cutoff_hz", "deep"): (20, 42),
    ("filters", "hp", "x"): (20, 51),
    ("filters", "hp", "last"): (20, 74),
    ("filters", "a", "b", "c"): (21, 9),
    ("many", "one"): (23, 7),
    ("unicod\u00e9", "k\u00e9y"): (27, 14),
}


def test_values_and_keys_are_found():
    assert {path: locate(TEXT, path) for path in EXPECTED} == EXPECTED
    assert locate(TEXT, ("rates", "ratio"), of_key=True) == (5, 3)
    assert locate(TEXT, ("filters", "hp", "last"), of_key=True) == (20, 67)


def test_what_is_not_there_is_looked_for_in_its_table():
    assert locate(TEXT, ("rates", "slow_hz")) == (3, 2)
    assert locate(TEXT, ("filters", "hp", "stop", "deep")) == (20, 1)
    assert locate(TEXT, ("nowhere", "at", "all")) == (1, 1)
    assert locate("", ("rates",)) == (1, 1)


def _paths(tables, prefix=()):
    for name, value in tables.items():
        yield (*prefix, name)
        if isinstance(value, dict):
            yield from _paths(value, (*prefix, name))


def test_every_path_of_the_tables_has_a_position_and_no_other():
    assert set(scan(TEXT)) - {("many", "one")} == set(_paths(tomllib.loads(TEXT)))


def test_odd_but_valid_texts_are_walked_to_their_end():
    for text in (
        "a = {}",
        "a = { }\nb = []",
        "a = [[[[]]]]\n[b]",
        'a = """x"""""\nb = 1',
        "a = ''\nb = ''''x'''''",
        'a = "\\\\"\nb = 1',
        "a.b = 1\na.c = 2",
        "a = " + "{ a = " * 40 + "1" + " }" * 40 + "\nb = 2",
        "a = " + "[" * 80 + "]" * 80 + "\nb = 2",
        "a = 1 # no newline at the end",
        "[a]",
        "[a] # b = 1\n\tb\t=\t1",
    ):
        assert {path for path in scan(text) if len(path) == 1} == {(name,) for name in tomllib.loads(text)}
