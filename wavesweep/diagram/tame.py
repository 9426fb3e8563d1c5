"""Moderate numbers for drawings in which structure is searched for, such as drift: different from key to key."""

from zlib import crc32

SALTS = "ab"  # of two drawings of the same structure
SPREAD = 997


def scattered(path: str, salt: str = "") -> int:
    """Return a whole number from 0 to SPREAD - 1 for a path, another one for most other paths and salts, always the same."""
    return crc32((salt + path).encode()) % SPREAD
