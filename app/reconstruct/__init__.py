"""From captures to a problem: what the pictures say about the shift, and the presets that solve it."""
