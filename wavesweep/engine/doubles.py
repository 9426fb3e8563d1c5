"""What numbers of double precision are good to."""

import numpy as np

# from 1 to the next double: twice what rounding moves a result by at most
EPS = np.finfo(float).eps
UNIT_ROUNDING = EPS / 2  # relative, what rounding moves a result by at most
ENTRY_ROUNDING = 4 * EPS  # of the terms of the entries of a block, relative
# of the terms of a sum, what rounding may leave of it if it is 0, in any order of the terms
CANCELLED_SUM = 64 * EPS
FEW_ROUNDINGS = 4 * EPS  # of a value, what the few operations that give it may move it by
LARGEST_DOUBLE = np.finfo(float).max
LEAST_NORMAL = np.finfo(float).tiny  # below which doubles have fewer digits
SMALLEST_DOUBLE = np.finfo(float).smallest_subnormal  # twice what a product loses that underflows
# in place of a zero, or added where something underflows: nothing else is as small
NEXT_TO_ZERO = 1e-300
# of the terms of a sum: one below it may be what rounding has left of them, even of a long calculation
GONE_SUM = 1e-9
# halvings of an interval, or squarings of what decays, after which no double changes
BY_TWO = 60
