"""The engine: multirate loops in, arrays out. It knows no files, no specs, no tables and no commands."""
