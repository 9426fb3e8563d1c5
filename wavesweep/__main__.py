"""`python -m wavesweep`: the command line."""

import sys

from wavesweep.cli import main

sys.exit(main())
