"""The pictures of a loop: its blocks and wires, and when they run and act."""
