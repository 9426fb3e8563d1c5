"""The report of a spec: one HTML file with its question, what is certified, figures, the spec,
and how to verify it."""
