"""The command as a program that hears the signals of a terminal, however the tests were started."""

import os
import subprocess
import sys

# Whoever runs the tests may have switched Ctrl-C off for its children, and `nohup` the end of the terminal.
PROGRAM = """
import signal, sys
from wavesweep.program.cli import main, messages
messages.FIRST_WORD = messages.MINUTE = 1e9  # a busy machine has no word on the time
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
sys.exit(main())
"""


def started(home, *words, **marks):
    """A run in a folder, in a process group of its own as on a terminal; marks: names and values for its environment."""
    arguments, streams = [sys.executable, "-c", PROGRAM, *map(str, words), "--no-plot"], subprocess.PIPE
    return subprocess.Popen(
        arguments, cwd=home, env=os.environ | marks, stdout=streams, stderr=streams, text=True, start_new_session=True
    )
