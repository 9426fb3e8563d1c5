"""The core: a spec, its loop, its stable intervals and responses, a sweep, its tables and figures, and the command line."""
