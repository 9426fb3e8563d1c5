"""Devices of several axes: linkages with their mass matrix at the hand, and flat walls, as
classes of blocks."""
