"""Images of the back wall: pixel geometry, the pattern's shift, the pixel integral."""

from core.render.image import render_flow as render_flow
from core.render.image import render_reference as render_reference
from core.render.light import pattern_image as pattern_image
from core.render.light import pattern_size as pattern_size
from core.render.pixel_geometry import PixelGeometry as PixelGeometry
from core.render.pixel_geometry import pixel_geometry as pixel_geometry
from core.render.pixels import PixelRenderer as PixelRenderer
from core.render.pixels import pixel_renderer as pixel_renderer
