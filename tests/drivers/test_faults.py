"""The short form; tests/benchmarks/faults.py runs ten thousand and prints the counts."""

from drivers.projector.protocol import PowerState
from drivers.simulated import CameraFault
from drivers.simulated.projector.engine import ProjectorFault
from tests.drivers.fault_storm import Storm, _judge_power, whole_storm


def test_no_fault_gives_a_wrong_result_a_hang_or_a_crash():
    storm = whole_storm(600, seed=1)
    counts = storm.counts()
    assert counts["wrong"] == []
    assert counts["longest_s"] < 10.0
    assert counts["faults"] >= 600
    assert len(counts["by_kind"]) == len(CameraFault) + len(ProjectorFault)
    assert counts["good"] > 500


def test_the_judge_notices_a_wrong_answer():
    storm = Storm(0)
    _judge_power(storm, "escvp21", PowerState.ON, {PowerState.STANDBY})
    assert storm.wrong
