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


def test_every_spec_of_the_project_is_valid():
    for path in shipped():
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
        assert [error.message[:300] for error in CHECKED.iter_errors(tables)] == [], path


SLIPS = {
    KIND: """
        [rates] ratio = 20.5 | [device] mass = 2020-01-01 | [device] mass = { value = 1 } | [device] mass = 0
        [device] "mass.x" = 1 | [[device]] mass = 1 | [devise] mass = 1 | [filters] lp1 = 3 | [filters] lp1.order = 13
        [environment] integration = "implict" | [environment] delay = "frames" | [sweep] B_V = [1]
        [sweep] b = { strt = 1, stop = 2 } | [sweep] b = [1, "x"] | [sweep] "device.mass" = [0.0]
        [sweep] require.damping = 0.3 | [for_all] b = { start = 1, end = 2 } | [sweep] "b." = [3]
        [design.vary] b = { start = 1, stop = 2, "" = [3] } | [design.wish] z_widht = {}
        [design.wish] z_width = { at_most = 3 } | [simulate] friktion = 1 | [simulate] frames = [{ tick = 3 }]
        [block.a] type = 'hold'
    """,
    DRAWN: """
        [block.a] type = "hol" | [block.a] type = "gain" @ k = [1] | [block.a] type = "gain" @ every = 0
        [block.a] type = "gain" @ k = 1 @ "" = {} | [numbers.q] value = 1 @ units = 'N' | [ports] hand = { force = "f" }
        [ports] hands = {} | [sweep] k = { strt = 1, stop = 2 } | [for_all] k = 2 | [design.wish] channel = {}
        [controller] kind = 'pmw'
    """,
}


@pytest.mark.parametrize("base", SLIPS)
def test_a_slip_of_one_key_is_marked_and_refused(base):
    sound = tomllib.loads(base)
    assert CHECKED.is_valid(sound)
    load(sound)
    for slip in re.split(r" \| |\n", SLIPS[base].strip()):
        table, keys = re.fullmatch(r"(\[+[\w.]+\]+) (.*)", slip.strip()).groups()
        slipped = tomllib.loads("\n".join([f"{base}{table}", *keys.split(" @ ")]))
        assert not CHECKED.is_valid(slipped), slip
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
