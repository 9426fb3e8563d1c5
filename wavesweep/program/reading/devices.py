"""Desktop haptic devices by name, with the source of each number.

Manufacturers publish a force limit, a resolution, and for some devices an apparent mass and a back-drive friction at
the tip in the middle of the workspace. They do not publish viscous damping, and rarely the direction or the place in
the workspace to which a number applies. A number without a public source is marked as assumed, or it is missing and a
spec has to give it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

PAPER = "the paper's section 2, for its analysis (it tests on an Omni)"
OMNI = "PHANTOM Omni data sheet, as commonly quoted; the Geomagic Touch has the same"
DESKTOP = "PHANTOM Desktop data sheet, as commonly quoted; the Geomagic Touch X has the same"
FALCON = "Novint Falcon product sheet, as commonly quoted"
OMEGA = "Force Dimension omega.3 data sheet, as commonly quoted"
CHAI3D = "CHAI3D, github.com/chai3d/chai3d, src/devices/"
PHANTOM_TABLE = f"{CHAI3D}CPhantomDevices.cpp"
DELTA_TABLE = f"{CHAI3D}CDeltaDevices.cpp"


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a device in the unit of its key, with its source; `assumed` if no public source is relied on."""

    value: float
    source: str
    assumed: bool = False


@dataclass(frozen=True, slots=True)
class HapticDevice:
    """A device along one direction.

    numbers: path of a key -> its number. wall: stiffness (N/m) and damping (N*s/m) of the stiffest wall that CHAI3D
    recommends at 1 kHz, and the source; None if it has no entry. The wall is no key: compare a result with it.
    """

    title: str
    numbers: Mapping[str, Number]
    wall: tuple[float, float, str] | None = None

    def loop(self) -> dict[str, float]:
        """Return the keys of the loop that the device sets, by path."""
        return {path: number.value for path, number in self.numbers.items() if path.startswith("device.")}

    def simulation(self) -> dict[str, float]:
        """Return the keys of [simulate] that the device sets, by their last name."""
        prefix = "simulate."
        numbers = self.numbers.items()
        return {path.removeprefix(prefix): number.value for path, number in numbers if path.startswith(prefix)}

    def unknown(self) -> tuple[str, ...]:
        """Return the paths of mass and damping if no number is known, so that a spec has to give its own."""
        return tuple(path for path in ("device.mass", "device.damping") if path not in self.numbers)


_PHANTOM_LIMIT = Number(3.3, PHANTOM_TABLE)
_FORCE_DIMENSION_LIMIT = Number(12.0, DELTA_TABLE)
_OMNI_NUMBERS = {
    "device.mass": Number(0.045, f"{OMNI}: apparent mass at the tip about 45 g"),
    "device.damping": Number(0.5, "not published: a third of what the paper's analysis takes for its device", assumed=True),
    "simulate.friction": Number(0.26, f"{OMNI}: back-drive friction below 0.26 N, the bound is taken"),
    "simulate.resolution": Number(0.055e-3, f"{OMNI}: about 0.055 mm (450 dpi)"),
    "simulate.max_force": _PHANTOM_LIMIT,
}
_GUESS = "not published: of the size that a three-legged device with geared-down motors has"

DEVICES: Mapping[str, HapticDevice] = MappingProxyType(
    {
        "paper": HapticDevice(
            "the device of the paper's analysis",
            {
                "device.mass": Number(0.1, PAPER),
                "device.damping": Number(1.5, PAPER),
                "simulate.friction": Number(0.0, "none, as in the paper's analysis", assumed=True),
                "simulate.resolution": Number(0.0, "no encoder, as in the paper's analysis", assumed=True),
                "simulate.max_force": _PHANTOM_LIMIT,
            },
        ),
        "touch": HapticDevice("3D Systems (Geomagic) Touch", _OMNI_NUMBERS, (400.0, 4.0, PHANTOM_TABLE)),
        "omni": HapticDevice("SensAble PHANTOM Omni", _OMNI_NUMBERS, (700.0, 5.0, PHANTOM_TABLE)),
        "desktop": HapticDevice(
            "SensAble PHANTOM Desktop, Geomagic Touch X",
            {
                "device.mass": Number(0.045, f"{DESKTOP}: apparent mass at the tip about 45 g"),
                "simulate.friction": Number(0.06, f"{DESKTOP}: back-drive friction below 0.06 N, the bound is taken"),
                "simulate.resolution": Number(0.023e-3, f"{DESKTOP}: about 0.023 mm (1100 dpi)"),
                "simulate.max_force": Number(7.9, PHANTOM_TABLE),
            },
            (1000.0, 5.0, PHANTOM_TABLE),
        ),
        "falcon": HapticDevice(
            "Novint Falcon",
            {
                "device.mass": Number(0.2, _GUESS, assumed=True),
                "device.damping": Number(2.0, _GUESS, assumed=True),
                "simulate.friction": Number(0.5, _GUESS, assumed=True),
                "simulate.resolution": Number(0.0635e-3, f"{FALCON}: better than 0.0635 mm (400 dpi)"),
                "simulate.max_force": Number(8.0, f"{DELTA_TABLE}; the product sheet has 8.9 N (2 lbf)"),
            },
            (3000.0, 20.0, DELTA_TABLE),
        ),
        "omega": HapticDevice(
            "Force Dimension omega.3, .6 and .7",
            {
                "simulate.resolution": Number(0.01e-3, f"{OMEGA}: below 0.01 mm, the bound is taken"),
                "simulate.max_force": _FORCE_DIMENSION_LIMIT,
            },
            (5000.0, 30.0, DELTA_TABLE),
        ),
        "sigma": HapticDevice(
            "Force Dimension sigma.7", {"simulate.max_force": _FORCE_DIMENSION_LIMIT}, (4000.0, 30.0, DELTA_TABLE)
        ),
        "lambda": HapticDevice(
            "Force Dimension lambda.7", {"simulate.max_force": _FORCE_DIMENSION_LIMIT}, (8000.0, 30.0, DELTA_TABLE)
        ),
    }
)
"""Devices by the name that `device.preset` takes."""
