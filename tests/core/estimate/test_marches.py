"""The share of the work that is told while a solve marches: nothing here marches."""

from core.estimate.marches import Marches
from core.watch import Watch


class Told(Marches):
    """Marches that keep the shares which they tell."""

    def __init__(self) -> None:
        self.shares: list[float] = []
        super().__init__(Watch(lambda row, growing: self.shares.append(float(row["share"]))))


def test_another_fit_begins_where_the_work_so_far_has_ended():
    marches = Told()
    marches.expect(10.0)
    marches.tell({"doing": "a"}, under_way=4.0)
    # Six of these ten never come: the fit ends early, and another one begins.
    marches.expect(10.0)
    for under_way in (4.0, 10.0):
        marches.tell({"doing": "b"}, under_way=under_way)
    assert marches.shares == [0.4, 0.4, 0.99]


def test_work_that_is_not_needed_counts_no_more():
    marches = Told()
    marches.expect(8.0)
    marches.tell({"doing": "look for heat"}, under_way=2.0)
    marches.forgo(4.0)
    marches.tell({"doing": "look for heat"}, under_way=2.0)
    assert marches.shares == [0.25, 0.5]
