"""Moderate numbers for drawings in which structure is searched for, such as drift: different from key to key."""

from zlib import crc32

SALTS = "ab"  # of two drawings of the same structure


def scattered(path: str, salt: str = "") -> float:
    """Return a number from 0 to 1 for a path, another one for other paths and salts, always the same."""
    return crc32((salt + path).encode()) / 2**32
