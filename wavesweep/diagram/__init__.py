"""Loops of several rates: blocks, their wires, and what follows from these by structure."""
