"""How sure a statement must be: each test gives one false alarm in twenty, and intervals hold 95 %."""

from scipy.special import ndtri

FALSE_ALARMS = 0.05
# A normal quantity lies more standard deviations than these off its mean in one case of twenty: to one side that was
# chosen before, and to either side.
TO_ONE_SIDE = float(ndtri(1.0 - FALSE_ALARMS))
EITHER_WAY = float(ndtri(1.0 - 0.5 * FALSE_ALARMS))
