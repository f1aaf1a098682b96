"""Refractive rays: clipped to the room, traced as deviations from straight lines."""

from core.rays.bundle import RayOutcome as RayOutcome
from core.rays.bundle import Rays as Rays
from core.rays.nonlinear import NonlinearTracer as NonlinearTracer
from core.rays.quasi_linear import QuasiLinearTracer as QuasiLinearTracer
from core.rays.straight import StraightTracer as StraightTracer
from core.rays.tracer import AbstractRayTracer as AbstractRayTracer
from core.rays.tracer import Bend as Bend
