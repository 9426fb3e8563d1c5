"""Several specs beside each other."""
