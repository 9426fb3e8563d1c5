"""What the commands ask of the loops of a spec: for each analysis its job, and what computes a
slice."""
