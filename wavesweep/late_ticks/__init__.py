"""Fast ticks that are late, each by another time: loops that are stable in whatever order long
and short ticks come."""
