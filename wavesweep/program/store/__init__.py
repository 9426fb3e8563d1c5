"""Files that a run leaves behind if it is stopped."""
