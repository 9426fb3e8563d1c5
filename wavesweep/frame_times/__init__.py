"""Frames as they were measured: which lengths occur, which follow which, and whether a run stays
within what is proved."""
