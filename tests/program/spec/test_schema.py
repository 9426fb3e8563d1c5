"""The JSON Schema of a spec, as an editor uses it, against what `load` accepts and refuses."""

import json
import re
import tomllib

import jsonschema
import pytest
from support.specs import shipped

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine.errors import SpecError
from wavesweep.program.cli import main
from wavesweep.program.spec import KEYS, load
from wavesweep.program.spec.schema import schema

CHECKED = jsonschema.Draft202012Validator(schema())
KIND = '[controller]\nkind = "pmw"\n'
DRAWN = (
    '[rates]\ntick_hz = 1000\n[block.m]\ntype = "mass"\nmass = 1.0\n[block.w]\ntype = "hold"\n'
    '[wire]\n"m.f" = "-w.y"\n"w.u" = "k*m.x + m.v"\n[numbers]\nk = 1.0\n'
)


@pytest.mark.parametrize("path", shipped(), ids=lambda path: path.stem)
def test_every_spec_of_the_project_is_valid(path):
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    assert [error.message[:300] for error in CHECKED.iter_errors(tables)] == []


@pytest.mark.parametrize(
    ("base", "slip"),
    [
        (KIND, slip)
        for slip in (
            "[rates]\nratio = 20.5",
            "[device]\nmass = 2020-01-01",
            "[device]\nmass = { value = 1 }",
            "[device]\nmass = 0",
            "[device]\ndampin = 1",
            '[device]\n"mass.x" = 1',
            "[[device]]\nmass = 1",
            "[devise]\nmass = 1",
            "[filters]\nlp1 = 3",
            "[filters]\nlp1.order = 13",
            '[environment]\nintegration = "implict"',
            '[environment]\ndelay = "frames"',
            "[sweep]\nB_V = [1]",
            "[sweep]\nb = { strt = 1, stop = 2 }",
            '[sweep]\nb = [1, "x"]',
            '[sweep]\n"device.mass" = [0.0]',
            "[sweep]\nrequire.damping = 0.3",
            "[for_all]\nb = { start = 1, end = 2 }",
            '[design.vary]\nb = { start = 1, stop = 2, "" = [3] }',
            '[sweep]\n"b." = [3]',
            "[design.wish]\nz_widht = {}",
            "[design.wish]\nz_width = { at_most = 3 }",
            "[simulate]\nfriktion = 1",
            "[simulate]\nframes = [{ tick = 3 }]",
            "[block.a]\ntype = 'hold'",
        )
    ]
    + [
        (DRAWN, slip)
        for slip in (
            '[block.a]\ntype = "hol"',
            '[block.a]\ntype = "mass"\nmas = 1.0',
            '[block.a]\ntype = "gain"\nk = [1]',
            '[block.a]\ntype = "gain"\nevery = 0',
            '[block.a]\ntype = "gain"\nk = 1\n"" = {}',
            "[numbers.q]\nvalue = 1\nunits = 'N'",
            '[ports]\nhand = { force = "f" }',
            "[ports]\nhands = {}",
            "[sweep]\nk = { strt = 1, stop = 2 }",
            "[for_all]\nk = 2",
            "[design.wish]\nchannel = {}",
            "[controller]\nkind = 'pmw'",
        )
    ],
)
def test_a_slip_of_one_key_is_marked_and_refused(base, slip):
    sound, slipped = tomllib.loads(base), tomllib.loads(f"{base}{slip}")
    assert CHECKED.is_valid(sound)
    load(sound)
    assert not CHECKED.is_valid(slipped)
    with pytest.raises(SpecError):
        load(slipped)


@pytest.mark.slow
def test_an_editor_finds_every_key_with_its_meaning(capsys):
    assert main(["keys", "--schema"]) == 0
    shown = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator.check_schema(shown)
    assert shown["$defs"]["device.mass"] == {
        "description": "mass of the haptic device (kg)",
        "default": 0.1,
        "exclusiveMinimum": 0.0,
        "type": "number",
    }
    assert set(KEYS) <= set(shown["$defs"])
    blocks = shown["else"]["properties"]["block"]["additionalProperties"]["allOf"]
    assert [each["if"]["properties"]["type"]["const"] for each in blocks] == list(TYPES)


@pytest.mark.parametrize(
    ("slip", "place"),
    [
        (KIND + "[device]\nmas = 0.1\ndamping = 1", ["device", "mas"]),
        (KIND + '[device]\nmass = "x"\ndamping = 1', ["device", "mass"]),
        (KIND + "[sweep]\nb = { start = 1, stop = 2, nm = 3 }", ["sweep", "b", "nm"]),
        (DRAWN.replace("mass = 1.0", "mas = 1.0"), ["block", "m", "mas"]),
        (DRAWN.replace('"hold"', '"hodl"'), ["block", "w", "type"]),
        (DRAWN + "[sweep]\nalnog = 1", ["sweep", "alnog"]),
    ],
)
def test_an_editor_marks_a_slip_once_and_at_its_place(slip, place):
    """Checked with taplo 0.9.3, which also refuses a `$ref` with spaces."""
    assert [list(error.absolute_path) for error in CHECKED.iter_errors(tomllib.loads(slip))] == [place]
    assert not re.search(r'"#/\$defs/[^"]* ', json.dumps(schema()))
