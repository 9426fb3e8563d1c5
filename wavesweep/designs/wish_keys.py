"""What may be wished for of a design: quantities, their bounds and options."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from wavesweep.capabilities import modules
from wavesweep.engine.keys import Key, Place
from wavesweep.program.reading.keys import ALL_MODES, KEYS, MODES, TIMES_OF_MODES
from wavesweep.program.reading.tables import nested

_STIFFNESS, _DAMPING = KEYS["environment.K_VE"], KEYS["environment.B_VE"]
_HZ = Key.positive("band_hz", None, "Hz", "lowest and highest frequency")
# Options of a wish by name.
_BAND = {"band_hz": Key.several(_HZ, 2, rising=True)}
_OF_WALL = {"B_VE": Key.several(_DAMPING)}
_WALLS = {"walls": Key.several(_STIFFNESS), **_OF_WALL}
_NUMBER = {"number": Key.word("number", None, "name of a number of [design.vary]")}
_MODES = {
    "modes": Key.word("modes", ALL_MODES, "which modes count", MODES),
    "slower_than": Key.positive(
        "slower_than", None, "s", "modes that fall to 1/e in less time do not count", high=1e6
    ),
}


@dataclass(frozen=True, slots=True)
class WishKind:
    """A quantity that may be wished for. more: whether more of it is better. title: its name in
    figures.

    ports: names in the [ports] of a drawn loop that it needs; None if no drawn loop has it. reads:
    how the paths begin of all numbers that it reads; empty if it reads the whole loop. measure: of
    one that a capability offers, from the loops of a batch, their number and its own options to the
    value of each, and whether that is certified. seen: the same by which a search ranks designs, with
    less that is proved; loops go one by one. within: the range of its values, outside of which no
    bound means anything.
    """

    unit: str
    more: bool
    title: str
    description: str
    options: Mapping[str, Key]
    ports: tuple[str, ...] | None = None
    reads: tuple[str, ...] = ()
    measure: Callable[..., tuple] | None = field(default=None, repr=False, compare=False)
    seen: Callable[..., tuple] | None = field(default=None, repr=False, compare=False)
    within: tuple[float | None, float | None] = (None, None)

    @property
    def own_options(self) -> tuple[str, ...]:
        """The names of its options beside those of walls."""
        return tuple(name for name in self.options if name not in _WALLS)

    @property
    def bound(self) -> str:
        """The key of its bound."""
        return "at_least" if self.more else "at_most"

    @property
    def keys(self) -> dict[str, Key]:
        """Its bound and its options by name."""
        low, high = self.within
        bound = Key.number(self.bound, None, self.unit, "", low=low, high=high)
        return {self.bound: bound, **self.options}


def _offered() -> Iterator[tuple[str, WishKind]]:
    """Yield what capabilities offer by name; what reads the whole loop is looked at with walls."""
    for module in modules("wish"):
        for name, wish in module.WISHES.items():
            kind = {"options": {}, **wish}
            if not wish.get("reads"):
                kind["options"] = {**kind["options"], **_WALLS}
            yield name, WishKind(**kind)


WISHES = MappingProxyType(
    {
        "z_width": WishKind(
            "N/m",
            True,
            "stiffest wall",
            "stiffest wall up to which every wall is stable, at most that of sweep.K_VE or 20000",
            _OF_WALL,
            ("wall",),
        ),
        "felt": WishKind(
            "N/m",
            True,
            "stiffness felt",
            "stiffness felt of that wall at rest",
            _OF_WALL,
            ("wall", "hand"),
        ),
        "transparency": WishKind(
            "1",
            False,
            "error of the response",
            "root mean square of |ln(H/H_dc)| over the logarithm of the frequency, within the band; H is the transmitted "
            "admittance, H_dc that of direct coupling",
            {**_BAND, **_WALLS},
        ),
        **dict(_offered()),
        "damping_ratio": WishKind(
            "1",
            True,
            "least damping ratio",
            "least damping ratio of the modes that count, which are those that need one in [sweep] require",
            {**_MODES, **_WALLS},
            (),
            within=(-1.0, 1.0),
        ),
        **{
            name: WishKind("s", False, time.title, time.description, _WALLS, (), within=(0.0, None))
            for name, time in TIMES_OF_MODES.items()
        },
        "largest": WishKind(
            "",
            True,
            "largest number",
            'a number of [design.vary] that is to be as large as possible, largest = "K", while the loop is stable and all '
            "other wishes are met",
            {**_NUMBER, **_WALLS},
            (),
        ),
        "smallest": WishKind(
            "",
            False,
            "smallest number",
            "the same of a number that is to be as small as possible",
            {**_NUMBER, **_WALLS},
            (),
        ),
        "delay_margin": WishKind(
            "tick",
            True,
            "delay margin",
            "further delay of the slow result up to which every delay is stable",
            _WALLS,
        ),
    }
)


def word_of(name: str) -> str:
    """The word of the kind of a wish: its name, without the number of one of several."""
    return re.sub("_[2-9]$", "", name)


@dataclass(frozen=True, slots=True)
class Wish:
    """A wish: its name (see `word_of`), its bound (None: as good as possible), and the values of
    its options.

    places: of its keys.
    """

    name: str
    bound: float | None
    options: Mapping[str, Any]
    places: Mapping[str, Place] = field(default_factory=dict, repr=False, compare=False)

    @property
    def word(self) -> str:
        """The word of its kind."""
        return word_of(self.name)

    @property
    def kind(self) -> WishKind:
        """What is wished for."""
        return WISHES[self.word]

    def margin(self, value: Any) -> Any:
        """Return the margin to the bound, as a share of it (of 1e-6 if it is 0); negative if the
        bound is violated."""
        share = (value - self.bound) / (abs(self.bound or 0.0) or 1e-6)
        return share if self.kind.more else -share

    def written(self) -> dict[str, object]:
        """Return the wish as a spec could give it."""
        bound = {} if self.bound is None else {self.kind.bound: self.bound}
        return nested({**bound, **self.options})
