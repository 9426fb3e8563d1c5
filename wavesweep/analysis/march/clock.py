"""Results of the slow loop on their way to the fast one. Time is a whole number of fast ticks."""

from __future__ import annotations

from typing import Any

Mail = tuple[tuple[int, Any], ...]
"""Results in the order in which they were computed, each with the tick from which it is held."""


def post(mail: Mail, result: Any, k: int, delay: int | None) -> Mail:
    """Send a result computed at tick ``k``, to be held from tick ``k + delay`` on; with None it is lost.

    Without delay nothing travels: who computed the result holds it at once, and what is still on its way is overtaken.
    """
    if delay is None:
        return mail
    return (*mail, (k + delay, result)) if delay else ()


def collect(held: Any, mail: Mail, k: int) -> tuple[Any, Mail]:
    """Give what is held at tick ``k``, and what is still on its way.

    Of the results that are due the one computed last wins, and one that was overtaken is not held any more.
    """
    for place in range(len(mail) - 1, -1, -1):
        if mail[place][0] <= k:
            return mail[place][1], mail[place + 1 :]
    return held, mail
