"""The command as a program that hears the signals of a terminal, however the tests were started."""

# Whoever runs the tests may have switched Ctrl-C off for its children, and `nohup` the end of the terminal.
PROGRAM = """
import signal, sys
from wavesweep.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
sys.exit(main())
"""
