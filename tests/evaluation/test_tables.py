"""From results to tables, figures and the page."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bayesgrasp.diagnostics.intervals import paired_difference, wilson
from bayesgrasp.evaluation.figures import plot_ladder, plot_per_object, plot_prior
from bayesgrasp.evaluation.journal import SceneResult
from bayesgrasp.evaluation.report import Picture, Section, write_report
from bayesgrasp.evaluation.strategies import LADDER, STRATEGIES
from bayesgrasp.evaluation.tables import LABELS, PAPER, markdown, markdown_per_object, summarize
from bayesgrasp.prior.grasp import GraspPrior

Make = Callable[..., SceneResult]


@pytest.fixture(scope="module")
def results(result: Make) -> list[SceneResult]:
    """The MAP from the image succeeds in 3 of 4, without it in 1 of 4; one object was never had by the model."""
    image = ("success", "success", "success", "unreachable")
    metric = ("success", "dropped", "collision", "unreachable")
    made = [
        result(n, {"map_success_ratio": m, "map_image": i, "map_full": "success"}, "mug")
        for n, (m, i) in enumerate(zip(metric, image, strict=True))
    ]
    return [*made, result(4, {"map_success_ratio": "dropped", "map_image": "success"}, "new")]


def test_every_strategy_has_a_label_and_the_paper_has_eight_rows() -> None:
    assert set(LABELS) == set(STRATEGIES)
    assert tuple(PAPER) == LADDER


def test_rates_intervals_and_counts(results: list[SceneResult]) -> None:
    summary = summarize(results, {"map_full": "not on new"})
    entry = summary["strategies"]["map_image"]
    assert entry["attempts"] == 5
    assert entry["success_rate"] == pytest.approx(0.8)
    assert entry["interval"] == pytest.approx(wilson(4, 5))
    assert entry["unreachable"] == 1
    assert entry["seconds_per_plan"] == pytest.approx(0.5)
    assert entry["per_object"]["mug"]["success_rate"] == pytest.approx(0.75)
    assert summary["strategies"]["map_full"]["attempts"] == 4
    assert set(summary["strategies"]["map_full"]["per_object"]) == {"mug"}
    assert json.loads(json.dumps(summary)) == summary


def test_differences_are_paired(results: list[SceneResult]) -> None:
    (worth, full, *_) = summarize(results)["differences"]
    assert (worth["first"], worth["second"]) == ("map_image", "map_success_ratio")
    assert worth["difference"] == pytest.approx(0.6)
    gains = np.array([0, 1, 1, 0, 1])
    assert worth["interval"] == pytest.approx(paired_difference(gains > 0, gains < 0)[1])
    assert full["attempts"] == 4


def test_markdown_has_the_papers_figures_beside_ours(results: list[SceneResult]) -> None:
    text = markdown(summarize(results, {"mle_full": "no mesh"}))
    assert "| 71 % | **80.0 %** |" in text
    assert "| 75 % | **80.0 %** |" in markdown(summarize(results), "unseen")
    assert "`mle_full` skipped: no mesh." in text
    assert "| new | 1 | 0 | 100 | - |" in markdown_per_object(summarize(results))


def test_figures_show_something(results: list[SceneResult], tmp_path: Path) -> None:
    summary = summarize(results)
    plot_ladder(summary, tmp_path / "ladder.png")
    plot_per_object(summary, tmp_path / "per_object.png")
    plot_prior(GraspPrior(), tmp_path / "prior.png", np.random.default_rng(0), 50)
    for path in tmp_path.iterdir():
        assert np.asarray(Image.open(path)).std() > 10, path


def test_the_page_holds_everything_itself(results: list[SceneResult], tmp_path: Path) -> None:
    plot_ladder(summarize(results), tmp_path / "ladder.png")
    pictures = (Picture(tmp_path / "ladder.png", "a < b"), Picture(tmp_path / "gone.png", "lost"))
    section = Section("Rates", ("`code` & text",), (markdown(summarize(results)),), pictures)
    write_report(tmp_path / "report.html", "Results <1>", [section])
    page = (tmp_path / "report.html").read_text()
    assert page.count("<img ") == page.count('src="data:image/png;base64,') == 1
    assert "There is no gone.png" in page
    assert "<code>code</code> &amp; text" in page
    assert "Results &lt;1&gt;" in page
    assert "argmax p(h | S=1, i)" in page, "an escaped bar is no column"
    assert page.count("<table>") == 2
    assert "http" not in page
