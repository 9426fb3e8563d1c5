"""The monodromy matrix of a loop: its ticks connected, one frame of them multiplied out, and cut at a number of the loop."""
