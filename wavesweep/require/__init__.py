"""What [sweep] requires of every mode, in place of stability alone."""
