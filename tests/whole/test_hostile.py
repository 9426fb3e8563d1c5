"""Hostile and extreme input: an answer in bounded time and memory, exit code 2 and a line, and nothing else.

WAVESWEEP_FUZZ=100000 in the environment asks for so many random tries of each kind instead of the sample, and for a tenth
as many whole commands.
"""

import os
import pathlib
import random
import re
import shutil
import tomllib
import warnings
from contextlib import suppress
from functools import partial

import pytest

from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.cli import main
from wavesweep.program.csv_files import read_csv
from wavesweep.program.spec import KEYS, load

TRIES = int(os.environ.get("WAVESWEEP_FUZZ", "0"))
HEAD = '[controller]\nkind = "pmw"\n[sweep]\nK_VE = { start = 0, stop = 20000 }\n'


def drawn(signals=(), numbers=(), **blocks):
    """A drawn loop around a mass, with these signals, numbers and blocks in addition."""
    blocks = {"m": {"type": "mass", "mass": 1}} | blocks
    tables = {f"block.{name}": keys for name, keys in blocks.items()} | {"signals": dict(signals), "numbers": dict(numbers)}
    wires = {"m.f": "-" + " - ".join(["m.x", *signals]), **{f"{name}.u": "m.x" for name in blocks if name != "m"}}
    tables |= {"wire": {f"'{port}'": text for port, text in wires.items()}, "rates": {"tick_hz": 1000}}
    lines = ([f"[{table}]", *(f"{name} = {value!r}" for name, value in keys.items())] for table, keys in tables.items())
    return "\n".join(line for part in lines for line in part) + "\n"


MANY_BLOCKS = (
    drawn()
    + "[type.chain.block.g]\ntype = 'gain'\n[type.chain.signals]\n"
    + "".join(f"s{n} = 'g.y'\n" for n in range(300))
    + "".join(f"[block.c{n}]\ntype = 'chain'\n" for n in range(100))
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("".join(f"k{n} = 1\n" for n in range(1001)), "at most 1000 keys"),
        ("#" * 3_000_000, "at most 2 MB"),
        (drawn(signals={"s0": "m.x"} | {f"s{n + 1}": f"s{n} + s{n}" for n in range(60)}), "s10: expected at most 2000 parts"),
        (drawn(numbers={"n0": 1} | {f"n{n + 1}": f"n{n} + n{n}" for n in range(60)}), "n10: expected at most 2000 parts"),
        (drawn(signals={"s0": "m.x"} | {f"s{n + 1}": f"-s{n}" for n in range(300)}), "200 within each other"),
        (drawn(long={"type": "tf", "num": [1.0], "den": [1.0] * 5000}), "long: expected at most 1200 states in all blocks"),
        (drawn(**{f"d{n}": {"type": "delay", "steps": 900} for n in (1, 2)}), "at most 1200 states in all blocks, found 1800"),
        (MANY_BLOCKS, "at most 10000 keys with those of all classes"),
        (f"{HEAD}b = {{ start = 1, stop = 2, num = {10**7} }}\n", "a whole number <= 1e\\+06"),
    ],
)
def test_a_spec_without_bound_is_refused(text, said, tmp_path):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(UsageError, match=said):
        load(tmp_path / "a.toml")


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        f"{'x' * 100_000} = 1\n",
        f"'{'x ' * 50_000}' = 1\n",
        f"{HEAD}b = {'1' * 5000}\n",
        f"{HEAD}b = {'1' * 300}\n",
        f'{HEAD}[measured]\nz_width = "{"x " * 50_000}"\n',
        f'{HEAD}[measured]\nz_width = "{"x" * 100_000}"\n',
    ],
)
@pytest.mark.parametrize("typed", ["b=1", f"{'x' * 100_000}=1", f"b={'x ' * 50_000}", f"b={'1' * 100_000}"])
def test_what_is_said_of_a_long_text_fits_a_screen(text, typed, tmp_path, capfd):
    (tmp_path / "a.toml").write_text(text)
    assert main(["--json", "check", str(tmp_path / "a.toml"), "--set", typed]) == 2
    said = capfd.readouterr()
    assert 60 < len(said.err) < 3000
    assert 60 < len(said.out) < 3000


def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "link").symlink_to("/dev/zero")
    for name, why in (("pipe", "found a pipe"), ("loop", "symbolic links"), ("link", "or a device"), (".", "found a folder")):
        with pytest.raises(UsageError, match=why):
            load(tmp_path / name)
        with pytest.raises(UsageError, match=why):
            read_csv(tmp_path / name, 1000)


@pytest.mark.parametrize("stem", ["=HYPERLINK(1)", "@SUM(1)", "a\nb", "\udcff", "NaN"])
def test_a_name_that_other_programs_would_run_or_misread_is_refused(stem, tmp_path):
    path = tmp_path / f"{stem}.toml"
    path.write_text(HEAD)
    with pytest.raises(UsageError, match=r"expected a name that is printable, does not begin with = \+ - @"):
        load(path)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("force_N\n1,2\n", "expected 1 values as in the header, found 2"),
        ('force_N\n"1\n2\n', "found none that can be read"),
        ("force_N\n" + "1" * 200 + "x\n", "found 1{60}$"),
    ],
)
def test_a_record_that_is_none_is_refused(text, why, tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(text)
    with pytest.raises(UsageError, match=why):
        read_csv(path, 1000).numbers(["force_N"])


WORDS = [
    *("[", "]", "{", "}", "=", ".", ",", '"', "'", '"""', "#", "\n", " ", "\0", "\x1b", "é", "\u2028", "-", "1e999", "-0.0"),
    *("nan", "inf", "1e308", "5e-324", "99999999999999999999", "0x7f", "true", "1979-05-27", "[[", "]]", "start", "stop"),
    *("num", "scale", '"log"', "along", "sweep", "bode", "simulate", "controller.kind", *KEYS),
]
BASE = (
    HEAD + 'B_VE = [0.5, 1.0]\n"device.mass" = { start = 0.1, stop = 0.2, num = 3, scale = "log" }\n'
    '[bode]\nfrequency_hz = [1, 10]\n[filters]\nlp1 = { order = 2, cutoff_hz = 10.0 }\n[simulate]\ninput = "sine"\n'
)


def mutated(rng, text):
    """The text with a few pieces left out, put in or repeated."""
    for _ in range(rng.randint(1, 6)):
        at = rng.randrange(len(text) + 1)
        end = min(len(text), at + rng.choice([0, 0, 1, 5, 40]))
        text = text[:at] + rng.choice(["", rng.choice(WORDS), text[at:end] * 2]) + text[end:]
    return text


def test_mutated_specs_overrides_and_records_are_answered(tmp_path):
    rng, known, path = random.Random(5), 0, tmp_path / "mutated.toml"  # noqa: S311 - a fixed sample, no secret
    record = tmp_path / "record.csv"
    for _ in range(TRIES or 200):
        path.write_text(mutated(rng, BASE), encoding="utf-8", errors="surrogateescape")
        sets = [mutated(rng, rng.choice(["b=40", "sweep.B_VE=[1, 2]", "sweep.b.num=3", "controller.kind=pmw"]))]
        record.write_text(mutated(rng, "time_s,force_N\n0.0,1.0\n0.001,2.0\n0.002,-1e3\n"), encoding="utf-8")
        tries = (partial(load, path), partial(load, {"controller": {"kind": "dc"}}, sets), partial(read_csv, record, 1000))
        for attempt in tries:
            with suppress(UsageError):
                attempt()
                known += 1
    assert known  # not all of them are refused


SHIPPED = sorted((pathlib.Path(__file__).parents[2] / "sweeps").rglob("*.toml"))
NUMBER = re.compile(r"(?<![\w.'\"])[-+]?\d[\d_]*(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
WRONG = [
    *("-1", "0", "-0.0", "0.5", "1.5", "1e7", "1e308", "1e-320", "9007199254740993", f"1{'0' * 400}", "nan", "inf", "-inf"),
    *("true", "1979-05-27", "[]", "[1, 2]", "{}", '{ value = "x" }', "{ start = 0 }"),
    *('""', '"nope"', '"dt"', '"((("', '"1/0"', '"sqrt(-1)"', '"exp(1000)"', '"2**0.5"', '"1 + 1j"'),
]


def places_of_numbers(text):
    """Start and end of each number in a spec, except for those in comments, texts and headers."""
    for found in NUMBER.finditer(text):
        before = text[text.rfind("\n", 0, found.start()) + 1 : found.start()]
        if "#" not in before and before.count('"') % 2 == 0 and not before.lstrip().startswith("["):
            yield found.span()


@pytest.mark.slow
def test_each_wrong_value_at_a_number_of_a_shipped_spec_is_a_mistake_or_taken(tmp_path):
    rng, mistakes = random.Random(3), 0  # noqa: S311 - a fixed sample, no secret
    texts = [path.read_text(encoding="utf-8") for path in SHIPPED]
    numbers = [(text, span) for text in texts for span in places_of_numbers(text)]
    for _ in range(TRIES or 40):
        text, (start, end) = rng.choice(numbers)
        (tmp_path / "a.toml").write_text(text[:start] + rng.choice(WRONG) + text[end:], encoding="utf-8")
        try:
            load(tmp_path / "a.toml")
        except UsageError as error:
            lines = str(error).splitlines()
            assert len(set(lines)) == len(lines)  # each is told once
            mistakes += 1
    assert mistakes


NUMBERS = [0.0, 5e-324, 1e-60, 1e-30, 1e-12, 1e-3, 0.1, 1.0, 7.0, 25.0, 500.0, 1e6, 1e12, 1e30, 1e60, 1e308]


def extreme(rng):
    """A spec with extreme values that are valid one by one."""
    chosen = [key for key in rng.sample(list(KEYS.values()), rng.randint(1, 5)) if key.type == "number"]
    values = {key.path: rng.choice(NUMBERS) for key in chosen}
    values |= {path: rng.choice([1, 2, 3, 20, 1000]) for path in ("rates.ratio",) if rng.random() < 0.3}
    values = {path: value for path, value in values.items() if not path.endswith(("band_hz", "band_db", "slow_hz", "at_s"))}
    lines = [f"{path} = {value!r}" for path, value in values.items()]
    lines += [f'controller.kind = "{rng.choice(["dc", "dc-slow", "dc-lm", "pmw", "pmw-lm"])}"']
    if rng.random() < 0.3:
        lines += ['device.velocity = "difference"'] * ("device.velocity" not in values)
    along, stop = rng.choice(["K_VE", "B_VE", "b", "device.mass", "device.damping"]), rng.choice([10.0, 1e5, 1e30, 1e60])
    lines += [f'sweep.along = "{along}"', f'sweep."{along}" = {{ start = {rng.choice([1e-3, 1.0])}, stop = {stop} }}']
    other = rng.choice([name for name in ("B_VE", "Kp", "b", "device.damping") if name != along])
    lines += [f'sweep."{other}" = [{rng.choice(NUMBERS[1:])!r}, {rng.choice(NUMBERS[1:])!r}]']
    lines += [f"bode.frequency_hz = [{rng.choice([0, 1e-9, 0.1, 10.0, 50.0])}, {rng.choice([1.0, 25.0, 100.0])}]"]
    kind = rng.choice(["sine", "chirp", "step", "pulse", "noise"])
    lines += [f'simulate.input = "{kind}"', f"simulate.duration_s = {rng.choice([0.001, 0.02, 0.3])}", "simulate.at_s = 0.0"]
    lines += [f"simulate.amplitude = {rng.choice([0.0, 1.0, 1e60])}", f"simulate.settle_s = {rng.choice([0.0, 2.0, 1e308])}"]
    return "\n".join(lines) + "\n"


@pytest.mark.slow
def test_whole_commands_with_extreme_numbers_say_a_clear_line(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    rng, codes, wrong = random.Random(12), [], []  # noqa: S311 - a fixed sample, no secret
    for n in range(TRIES // 10 or 6):
        text = extreme(rng)
        tomllib.loads(text)
        (tmp_path / "extreme.toml").write_text(text)
        command = ["zwidth", "stability-region", "bode", "passivity", "simulate", "check"][n % 6]
        more = [] if command == "check" else ["--out", "out", "--overwrite", *(["--no-plot"] if n % 4 else [])]
        more += [] if command in ("check", "simulate") else ["--jobs", "1"]
        with warnings.catch_warnings():
            warnings.simplefilter("default")  # as at a user's terminal, and not errors as in the tests
            codes.append(main([command, "extreme.toml", *more]))
        said = capfd.readouterr()
        case = f"{command}\n{text}\n{said.err}"
        clear = not any(word in said.err for word in ("Traceback", "a fault of wavesweep", "Warning"))
        inside = {file.name for file in tmp_path.iterdir()} <= {"extreme.toml", "out"}
        if not (codes[-1] in (0, 1, 2) and clear and inside):
            wrong.append(case)
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
    assert 0 in codes
    assert not wrong, f"{len(wrong)} of {len(codes)}:\n" + "\n".join(wrong)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            drawn(m={"type": "mass_matrix", "axes": ["x", "vx"], "mass": [[1, 2]]}).replace("m.f", "m.fx"),
            "block.m.axes: expected names of which none is v and another one, as outputs are called, found 'vx'",
        ),
        (
            drawn(numbers={"w": "9**9**9**9"}).replace("-m.x", "-w*m.x"),
            "numbers.w: expected a finite number, found a division by zero, a root",
        ),
        (
            drawn(numbers={"k": 0.0, "w": "1/k"}).replace("-m.x", "-w*m.x"),
            "numbers.w: expected a finite number, found a division by zero, a root",
        ),
    ],
)
def test_what_does_not_fit_is_told_once_where_it_stands(text, said):
    with pytest.raises(SpecError) as raised:
        load(tomllib.loads(text))
    (mistake,) = [one for one in raised.value.mistakes if "axes" in str(one) or "finite" in str(one)]
    assert said in str(mistake)
