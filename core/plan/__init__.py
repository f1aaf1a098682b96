"""Before measuring: what this rig would see of this room, what it would miss, and what a solve would cost."""
