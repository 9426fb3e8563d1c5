"""What [sweep] require asks for, in words."""

from collections.abc import Mapping

from wavesweep.capabilities import modules


def required_in_words(written: Mapping[str, object]) -> str:
    """What [sweep] require asks for, in words; written: its table."""
    return next((module.words_of(written) for module in modules("bound")), f"[sweep] require = {dict(written)}")


def where_nothing_decides() -> str:
    """What a requirement finds of loops whose modes neither grow nor decay, in words; empty if it finds none."""
    return next((module.BOUNDED for module in modules("bound")), "")
