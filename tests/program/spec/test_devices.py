"""A device preset sets the keys that a spec does not give itself, for every command, and each number has its source."""

import pytest

from wavesweep.engine._keys.checking import check
from wavesweep.engine.errors import SpecError
from wavesweep.program.reading.keys import DEVICES, HARDWARE_KEYS
from wavesweep.program.spec import KEYS, load

LOOP = {"controller": {"kind": "pmw"}}
COMPLETE = [name for name, device in DEVICES.items() if not device.unknown()]
INCOMPLETE = [name for name in DEVICES if name not in COMPLETE]


def on(name, **own):
    return LOOP | {"device": {"preset": name} | own}


@pytest.mark.parametrize("name", DEVICES)
def test_every_number_fits_its_key_and_has_a_source(name):
    device = DEVICES[name]
    assert device.title
    for path, number in device.numbers.items():
        assert check((KEYS | HARDWARE_KEYS)[path], number.value) == number.value
        assert number.source
        # Nobody publishes viscous damping, so none may pass as published, but for the paper's own.
        assert path != "device.damping" or number.assumed or name == "paper"
    assert name == "paper" or device.wall[2].startswith("CHAI3D")


@pytest.mark.parametrize("name", COMPLETE)
def test_a_device_sets_keys_that_are_not_given(name):
    device, spec = DEVICES[name], load(on(name))
    assert {path: spec.values[path] for path in device.loop()} == device.loop()
    assert {key: spec.hardware[key] for key in device.simulation()} == device.simulation()
    assert (spec.preset, load(LOOP).preset) == (name, None)
    assert spec.given == {"controller.kind", "device.preset", *device.numbers}


def test_given_keys_take_precedence():
    spec = load(on("touch", mass=0.1))
    assert (spec.values["device.mass"], spec.values["device.damping"]) == (0.1, 0.5)
    assert (spec.hardware["friction"], spec.hardware["resolution"]) == (0.26, 0.055e-3)
    assert load(on("touch"), ["device.mass=0.2"]).values["device.mass"] == 0.2


@pytest.mark.parametrize("name", INCOMPLETE)
def test_a_number_that_is_not_published_has_to_be_given(name):
    with pytest.raises(SpecError) as error:
        load(on(name))
    assert [mistake.key for mistake in error.value.mistakes] == list(DEVICES[name].unknown())
    own = {path.split(".")[1]: 0.3 for path in DEVICES[name].unknown()}
    spec = load(on(name, **own))
    assert {path: spec.values[path] for path in DEVICES[name].unknown()} == dict.fromkeys(DEVICES[name].unknown(), 0.3)


def test_a_spec_with_a_device_is_the_one_with_its_numbers():
    numbers = DEVICES["touch"].loop()
    explicit = load(LOOP | {"device": {path.split(".")[1]: value for path, value in numbers.items()}})
    assert load(on("touch")).sha256 == explicit.sha256
