"""The table of commands. A new command is a line here and a module of its name with a `command` in it."""

from types import MappingProxyType

# The short helps stand here so that `wavesweep --help` need not import the commands; a test holds them against these.
COMMANDS = MappingProxyType(
    {
        "zwidth": "Find the stable intervals of the stiffness K_VE for each B_VE and each other axis.",
        "stability-region": "Find the stable intervals along any axis for every combination of the others.",
        "bode": "Compute transmitted admittance and impedance over frequency, a curve per spec.",
        "simulate": "Run both loops tick by tick, with what a real rig adds to the linear model.",
        "passivity": "Find how far the wave channel and the hand's port are from passive.",
        "paper": "Draw every figure of the paper and judge every statement of it.",
        "bench": "Measure run time against error, this tool beside what a user would write instead.",
        "check": "Validate a spec and say what would be computed, and how.",
    }
)


def module_of(name: str) -> str:
    """Give the module that a command lives in."""
    return f"wavesweep.cli.{name.replace('-', '_')}"
