"""The verdict on a spec's own design."""
