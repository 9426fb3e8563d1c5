"""What the user asked for, as values with units; every mistake of a spec at once."""
