"""Mass, damping, spring, friction and delay of a device from a log of force and position."""
