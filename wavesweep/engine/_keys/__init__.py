"""Keys, values with their places, and the checks of one against the other."""
