"""Planes of two or three numbers in parts that are proved stable, proved unstable, or open."""
