"""`python -m wavesweep`: the command line."""

import sys

from wavesweep.core.cli import main

sys.exit(main())
