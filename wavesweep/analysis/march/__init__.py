"""Both loops run tick by tick: the witness of every other analysis, and the paper's experiment."""

from wavesweep.analysis.march.linear import March, State, at_rest, compile_loop, march

__all__ = ["March", "State", "at_rest", "compile_loop", "march"]
