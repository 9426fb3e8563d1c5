"""What [sweep] require asks for, in words."""

from collections.abc import Mapping

from wavesweep.capabilities import offered


def required_in_words(written: Mapping[str, object], *, drawn: bool) -> str:
    """What [sweep] require asks for, in words; written: its table. drawn: whether the spec draws
    its loop."""
    module = offered("bound")
    if module:
        return module.words_of(written, "tick" if drawn else "T_s")
    return f"[sweep] require = {dict(written)}"


def where_nothing_decides() -> str:
    """What a requirement finds of loops whose modes neither grow nor decay, in words; empty if
    it finds none."""
    module = offered("bound")
    return module.BOUNDED if module else ""
