"""The pages of all controllers with each of their keys, against an interpreter of the documents."""

import pytest
from meaning.judge import compiled, judge

from wavesweep.haptics.controller_page import assumption_of_page
from wavesweep.program.spec import load

DC, WAVES = ("dc", "dc-slow", "dc-lm"), ("pmw", "pmw-mean", "pmw-lm")
KEYS = {  # of a page: what is written, and for which controllers
    "defaults": ("", (*DC, "dc-vc", "dc-vc-lm", *WAVES)),
    "an amplifier that is two ticks late": ("device.delay = 2", (*DC, *WAVES)),
    "a motor that is late by a part of a tick": ("device.dead_time = 0.0004", (*DC, "pmw-lm")),
    "velocity of an encoder": ('device.velocity = "difference"', (*DC, "dc-vc", *WAVES)),
    "a hand": ("operator = { mass = 0.2, damping = 3.0, stiffness = 150.0 }", ("dc-slow", "dc-vc", *WAVES)),
    "an explicit wall that is late": ('environment = { integration = "explicit", delay = 3 }', ("dc-slow", "dc-lm", *WAVES)),
    "a trapezoidal wall": ('environment.integration = "trapezoidal"', WAVES),
    "a wall that is a frame late": ('environment.delay = "frame"', ("dc-slow", "dc-lm", "dc-vc", *WAVES)),
    "rates that do not divide": ("rates = { fast_hz = 1000.0, slow_hz = 300.0 }", ("dc-slow", "dc-lm", *WAVES)),
    "an avatar that is corrected": ("controller = { Kp = 20.0, b = 40.0 }", WAVES),
    "a local model at once": ("local_model = { K_LM = 200.0, B_LM = 0.4, delay = 0 }", ("dc-lm", "pmw-lm")),
    "an explicit local model": ('local_model = { K_LM = 200.0, integration = "explicit" }', ("pmw-lm",)),
    "no filters": ("filters = { lp1.order = 0, hp.order = 0, lp2.order = 0 }", WAVES),
    "steep filters": ("filters = { lp1 = { order = 4, cutoff_hz = 8.0 }, lp2 = { order = 3, cutoff_hz = 30.0 } }", ("pmw-lm",)),
}
CASES = [(key, kind) for key, (_, kinds) in KEYS.items() for kind in kinds]


def spec_of(key: str, kind: str) -> str:
    """A spec with a soft wall, four ticks a frame, and the line of a key."""
    tables = ["[sweep]", 'along = "K_VE"', "K_VE = { start = 0, stop = 3000 }"]
    given = KEYS[key][0]
    names = {"rates": "ratio = 4", "controller": "", "environment": "K_VE = 60.0"}
    lines = []
    for table, own in names.items():
        if not given.startswith(f"{table} ="):
            lines += [f"{table}.{own}"] if own else []
    kept = given.replace("controller = { ", f'controller = {{ kind = "{kind}", ')
    if kept == given:
        lines.append(f'controller.kind = "{kind}"')
    return "\n".join([*lines, kept, *tables]) + "\n"


@pytest.mark.asks("simulation")
@pytest.mark.parametrize(("key", "kind"), CASES)
def test_a_page_is_what_the_documents_say(key, kind, tmp_path):
    """The radius, and the motions of some frames."""
    text = spec_of(key, kind)
    found = judge(text, compiled(text, tmp_path), ticks=14, whole=False)
    assert [one for one in found if not one.same] == []
    assert found[0].what == "radius"


@pytest.mark.parametrize(("slow_hz", "said"), [(250.0, ""), (300.0, "mean of 3 ticks, a frame being 3.33333, ")])
def test_a_mean_of_other_ticks_than_a_frame_has_is_said(slow_hz, said):
    spec = load({"rates": {"fast_hz": 1000.0, "slow_hz": slow_hz}, "controller": {"kind": "pmw-mean"}})
    assert assumption_of_page(spec.values).partition("implicit")[0] == said


@pytest.mark.slow
@pytest.mark.asks("simulation")
@pytest.mark.parametrize("kind", KEYS["defaults"][1])
def test_stable_walls_and_responses_of_a_page_are_those_of_the_documents(kind, tmp_path):
    text = spec_of("an amplifier that is two ticks late" if kind in (*DC, *WAVES) else "defaults", kind)
    found = judge(text, compiled(text, tmp_path), required=False)
    assert [one for one in found if not one.same] == []
    assert {"radius", "label"} <= {one.what for one in found}
