"""A short search for the worst hand, for tests of all that comes after the search."""

from wavesweep.analysis.passivity import hand


def quick_search(monkeypatch):
    """Try a third of the hands: the proof, or the table, has to be right all the same."""
    for name, count in (("EDGE", 16), ("SPREAD", 60), ("SEEDS", 2)):
        monkeypatch.setattr(hand, name, count)
