"""Reading: keys with types and ranges, values with their places, and every mistake at once."""
