"""Of all that a result says of itself, what its reader must not miss."""

from collections.abc import Iterable, Sequence

# Words of every sentence that bids distrust of a whole result. Swapped pictures explain the rest, so they come first.
_DOUBTS = ("may be swapped", "does not match this capture", "Check that thermometer", "distrust")
# Words of every sentence that sends people to look at the room or an entry. Heat that is missing may explain a wrong
# entry, so it comes first.
_CHECKS = (
    "State it as a heater",
    "Look for a source",
    "Check it",
    "is not as stated",
    "airlens calibrate wall",
)


def doubts(sentences: Iterable[str]) -> tuple[str, ...]:
    """Of what a result says, what must be looked into before it is believed, the most telling first."""
    return _picked(sentences, _DOUBTS)


def checks(sentences: Iterable[str]) -> tuple[str, ...]:
    """Of what a result says, what is to be looked at in the room or among the entries, missing heat first."""
    return _picked(sentences, _CHECKS)


def _picked(sentences: Iterable[str], words: Sequence[str]) -> tuple[str, ...]:
    """The sentences with any of these words, in the order of the words."""
    said = tuple(sentences)
    return tuple(dict.fromkeys(one for word in words for one in said if word in one))
