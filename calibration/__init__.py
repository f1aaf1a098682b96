"""From images to camera, projector, wall and response models. Images in, models out; no devices."""
