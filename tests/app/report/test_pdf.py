"""The report to hand on: three sentences for an answer, what would make it surer, and two pages of PDF."""

import dataclasses
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import create_cli
from app.reconstruct.presets import PRESETS
from app.report.answer import advice, summary, tiles
from app.report.finding import read_finding
from app.report.indoor import told
from app.report.pdf import _short, method, write_pdf
from core.estimate.diagnostics import doubtful, other_way
from core.metrics import score_temperature
from tests.app.report.test_indoor import experiment  # noqa: F401


def pages(content: bytes) -> int:
    return len(re.findall(rb"/Type /Page\b", content))


@pytest.fixture(scope="module")
def finding(experiment):  # noqa: F811
    return read_finding(experiment, experiment.results_folder / "one")


def test_the_answer_is_three_sentences_without_jargon(finding):
    said = summary(finding)
    assert len(said) == 3
    # 295 K at the floor and 2 K/m: 21.85 °C, and vertices from 0.3 to 1.7 m, 1.0 m on the mean, are in the zone.
    assert "23.9 °C" in said[0]
    assert "0.100 m/s (0.090 to 0.109)" in said[0]
    assert "category" in said[0]
    assert "90 times an hour" in said[1]
    assert "3.6 K warmer than at the floor" in said[1]
    assert "no truth" in said[2]
    assert not any(word in " ".join(said) for word in ("rms", "sigma", "posterior", "px"))


def test_a_reason_not_to_believe_it_stands_before_the_answer(finding):
    swapped, distrusted = other_way(-0.8)[0], doubtful(0.7)[0]
    manifest = {**finding.manifest, "assumed": [distrusted, "Nothing else.", swapped]}
    doubted = dataclasses.replace(finding, manifest=manifest)
    assert summary(doubted) == (f"Before you believe this: {swapped}", *summary(finding))
    assert advice(doubted) == (distrusted, *advice(finding))


def test_where_no_velocity_was_found_the_answer_says_so(finding):
    alone = dataclasses.replace(finding.solution, velocity_m_s=None, velocity_std_m_s=None)
    said = summary(dataclasses.replace(finding, solution=alone))
    assert said[0] == "Where people are the air is 23.9 °C (23.8 to 23.9) on the mean."
    assert said[1].startswith(
        "At the ceiling the air is 3.6 K warmer than at the floor; its velocity was not found"
    )


def test_the_error_that_is_told_is_that_of_the_air_and_not_of_surfaces(finding):
    found_k = np.asarray(finding.solution.temperature_k)
    true_k = found_k + 0.25
    true_k[:, :, 0] += 20.0
    known = dataclasses.replace(finding)
    vars(known)["scores"] = {"T": score_temperature(found_k, true_k, 293.15), "u": None}
    assert summary(known)[2].endswith("the answer is wrong by 0.25 K in the air.")


def test_a_text_that_is_too_long_for_the_pdf_ends_with_a_whole_sentence():
    assert _short("One. Two. Three.", 12) == "One. Two."
    assert _short("A first one that is too long. Two.", 12) == "A first one that is too long."
    assert _short("supply: x; outlet: y; wall: z", 22, "; ") == "supply: x; outlet: y;"
    assert _short("One. Two.", 12) == "One. Two."


def test_what_is_seen_at_a_glance_is_what_the_table_tells(finding):
    shown = {one.name: one for one in tiles(finding)}
    table = {one.key: told(one) for one in finding.indoor.quantities}
    assert (shown["air changes"].value, shown["air changes"].interval) == table["air_changes"][1:]
    assert shown["draught rate, 95th percentile"].means.startswith("category")


def test_a_room_without_thermometers_is_told_to_hang_them(finding):
    assert any("thermometers" in sentence for sentence in advice(finding))


def test_the_method_is_that_of_the_preset():
    assert "No flow is computed." in method("draft")
    assert "flow solver" not in method("draft")
    for name in PRESETS:
        assert len(method(name)) > len(method("unknown")), name


def test_the_pdf_has_two_pages_with_pictures(finding, tmp_path):
    write_pdf(finding, tmp_path / "report.pdf")
    content = (tmp_path / "report.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert pages(content) == 2
    assert content.count(b"/Subtype /Image") >= 3


def test_the_command_writes_it(experiment):  # noqa: F811
    ran = CliRunner().invoke(create_cli(), ["report", str(experiment.folder), "--pdf"])
    assert ran.exit_code == 0, ran.output
    assert pages((experiment.results_folder / "one" / "report.pdf").read_bytes()) == 2
