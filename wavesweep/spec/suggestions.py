"""The nearest known name to one that is not known."""

from __future__ import annotations

from collections.abc import Iterable

LONGEST_COMPARED = 80  # difflib takes quadratic time, and no name of ours comes near this length


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the one of `known` that `name` was most likely meant to be, or an empty string.

    The same name under another table or in other case wins over the closest spelling.
    """
    known = list(dict.fromkeys(known))
    if len(name) > LONGEST_COMPARED:
        return ""
    last = _last(name)
    for same in (lambda one: _last(one) == last, lambda one: _last(one).lower() == last.lower()):
        matches = [one for one in known if same(one)]
        if len(matches) == 1:
            return matches[0]
    import difflib

    close = difflib.get_close_matches(name, known, n=1) or _close_in_last(last, known)
    return close[0] if close else ""


def _close_in_last(last: str, known: list[str]) -> list[str]:
    import difflib

    close = difflib.get_close_matches(last, [_last(one) for one in known], n=1)
    return [one for one in known if _last(one) in close][:1]


def _last(name: str) -> str:
    return name.rsplit(".", 1)[-1]
