"""The report of a spec: one HTML file with its question, what is proved, figures, the spec, and how to verify it."""
