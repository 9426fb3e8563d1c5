"""Haptics: the controllers of the paper, hands that hold a device, and what they feel, from the
loops of the engine."""
