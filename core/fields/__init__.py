"""Fields of excess refractivity: on a grid (trilinear, cubic), from a network, from a formula."""

from core.fields.field import AbstractField as AbstractField
from core.fields.grid import GridField as GridField
