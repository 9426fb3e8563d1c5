"""The program around the engine: specs as files, sweeps and workers, tables, figures, the
library and the commands."""
