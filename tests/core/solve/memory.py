"""A checkpoint store without a disk."""


class Memory(dict):
    """Blobs by name, and all of those that were ever set, newest first."""

    def __init__(self):
        super().__init__()
        self.kept = []

    def __setitem__(self, name, content):
        super().__setitem__(name, content)
        if name.isdigit():
            self.kept.insert(0, content)
