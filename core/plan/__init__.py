"""Before anybody measures: what this rig would see of this room, what it would not, and at what price."""
