"""The modes of a loop at all its rates, and their root locus over a number."""
