"""Why a limit is where it is: how it moves with every number of the loop."""
