"""Desktop haptic devices by name, for experiments with the numbers of a real machine.

Manufacturers publish a force limit, a resolution, and for some devices an apparent mass and a back-drive friction at
the tip in the middle of the workspace. They do not publish viscous damping, and rarely the direction or the place in
the workspace to which a number applies. The sources of published and of assumed numbers are part of each preset.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class HapticDevice:
    """A device along one direction: SI units; `published` and `assumed` name the sources of its numbers."""

    mass: float
    damping: float
    friction: float
    resolution: float
    max_force: float
    published: str
    assumed: str

    def loop(self) -> dict[str, float]:
        """Return the keys of the loop that the device sets."""
        return {"device.mass": self.mass, "device.damping": self.damping}

    def beyond_the_model(self) -> dict[str, float]:
        """Return the keys of [simulate] that the device sets."""
        return {"friction": self.friction, "resolution": self.resolution, "max_force": self.max_force}


DEVICES: Mapping[str, HapticDevice] = MappingProxyType(
    {
        "paper": HapticDevice(
            mass=0.1,
            damping=1.5,
            friction=0.0,
            resolution=0.0,
            max_force=3.3,
            published="mass and damping: the paper's section 2, for its analysis (it tests on an Omni)",
            assumed="no friction and no encoder, as the analysis has it; the force limit of the Phantom Omni",
        ),
        "phantom-omni": HapticDevice(
            mass=0.045,
            damping=0.5,
            friction=0.26,
            resolution=0.055e-3,
            max_force=3.3,
            published="SensAble Technologies, PHANTOM Omni data sheet as commonly quoted (the Geomagic Touch's says "
            "the same): apparent mass at the tip about 45 g, back-drive friction below 0.26 N (its upper bound is "
            "taken), nominal position resolution about 0.055 mm (450 dpi), maximum force 3.3 N",
            assumed="damping: a third of what the paper's analysis takes for its device",
        ),
        "novint-falcon": HapticDevice(
            mass=0.2,
            damping=2.0,
            friction=0.5,
            resolution=0.0635e-3,
            max_force=8.0,
            published="Novint Technologies, Falcon product sheet as commonly quoted: position resolution better than "
            "400 dpi (0.0635 mm), force above 2 lbf (8.9 N); CHAI3D, constructor of cFalconDevice: 8.0 N, taken here",
            assumed="mass, damping and friction: of the size that a three-legged device with geared-down motors has; "
            "no published figure is relied on",
        ),
    }
)
"""Named devices: ``paper``, ``phantom-omni``, ``novint-falcon``."""
