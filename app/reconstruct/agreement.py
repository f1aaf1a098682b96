"""Does the model see what the camera saw? The rendered reference against the captured one, in a crop."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float32

from app.experiment.captures import Capture
from core.geometry import crop
from core.render import render_reference
from core.scene import Scene

_CROP_PX = 256


def rendered_agreement(scene: Scene, reference: Capture) -> str:
    """A sentence: the correlation of rendered and captured reference in the middle of each view.

    Near 1 when geometry and pattern are right; near 0 when the wrong pattern is shown or the calibration
    is off by more than the finest feature. The reconstruction compares captures, so it does not depend
    on this; rays do.
    """
    worst = min(_correlation(scene, view, image.mean) for view, image in enumerate(reference.images))
    verdict = (
        "the calibrated geometry holds"
        if worst > 0.5
        else "the calibration or the pattern does not match this capture: check both before trusting positions"
    )
    return f"Rendered against captured reference: correlation {worst:.3f} ({verdict})."


def _correlation(scene: Scene, view: int, image: Float32[np.ndarray, "rows cols"]) -> float:
    camera = scene.views[view].camera
    cols, rows = min(_CROP_PX, camera.width_px), min(_CROP_PX, camera.height_px)
    left, top = (camera.width_px - cols) // 2, (camera.height_px - rows) // 2
    middle = crop(camera, slice(top, top + rows), slice(left, left + cols))
    views = [replace(v, camera=middle, marks=()) if i == view else v for i, v in enumerate(scene.views)]
    rendered = render_reference(replace(scene, views=tuple(views)), view)
    captured = image[top : top + rows, left : left + cols]
    if rendered.std() == 0 or captured.std() == 0:
        return 0.0
    return float(np.corrcoef(rendered.ravel(), captured.ravel())[0, 1])
