"""`python -m wavesweep`: the command line."""

import sys

from wavesweep.program.cli import main

sys.exit(main())
