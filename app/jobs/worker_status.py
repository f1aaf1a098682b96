"""How a worker ends: its exit status, which it also leaves in exit.json."""

DONE = 0
FAILED = 1
NO_SPACE = 74
STOPPED = 75  # checkpoint written, resumable
FENCED = 76  # a newer attempt owns the job
TAKEN = 77  # another process already runs this attempt
VANISHED = -1  # it left no word
