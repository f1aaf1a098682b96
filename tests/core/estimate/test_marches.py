"""The share of the work that is told while a solve marches: nothing here marches."""

from core.estimate.marches import Marches
from core.watch import Watch


class Told(list[float]):
    """The shares that were told."""

    def marches(self) -> Marches:
        """Marches that tell them."""
        return Marches(Watch(lambda row, growing: self.append(float(row["share"]))))


def test_another_fit_begins_where_the_work_so_far_has_ended():
    told = Told()
    marches = told.marches()
    marches.expect(10.0)
    marches.tell({"doing": "a"}, under_way=4.0)
    # Six of these ten never come: the fit ends early, and another one begins.
    marches.expect(10.0)
    marches.tell({"doing": "b"}, under_way=4.0)
    marches.tell({"doing": "b"}, under_way=10.0)
    assert told == [0.4, 0.4, 0.99]


def test_work_that_is_not_needed_counts_no_more():
    told = Told()
    marches = told.marches()
    marches.expect(8.0)
    marches.tell({"doing": "look for heat"}, under_way=2.0)
    marches.forgo(4.0)
    marches.tell({"doing": "look for heat"}, under_way=2.0)
    assert told == [0.25, 0.5]
