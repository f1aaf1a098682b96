"""Fields of excess refractivity: on a grid (trilinear, cubic), from a network, from a formula."""

from core.fields.field import AbstractField as AbstractField
from core.fields.field import Components as Components
from core.fields.field import apart as apart
from core.fields.formula import FunctionField as FunctionField
from core.fields.plume import plume as plume
from core.fields.spline import SplineField as SplineField
from core.fields.spline import through_vertices as through_vertices
from core.fields.vertex_field import GridField as GridField
