"""The picture of a loop."""
