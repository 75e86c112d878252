"""From scene results to the paper's table: rates with Wilson intervals, paired differences, Markdown and JSON.

Unreachable grasps (no motion of the arm brings the hand there) are failures, and also counted apart; so are plans that
were declined. Beside the success of the lift stands a harder label, never trained for: that the lifted object was also
held against pushes from six sides (`lift.hold`). A difference of two strategies is the mean over scenes of
S_a - S_b, with the interval of paired attempts, so what both find hard cancels.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from bayesgrasp.diagnostics.intervals import paired_difference, wilson
from bayesgrasp.diagnostics.promises import PARTS, Promises, keep_promises
from bayesgrasp.evaluation.journal import SceneResult, Trial
from bayesgrasp.evaluation.strategies import STRATEGIES

PAPER: dict[str, dict[str, float]] = {
    "prior_sample": {"train": 0.008},
    "prior_argmax": {"train": 0.006},
    "mle_success_ratio": {"train": 0.43},
    "map_success_ratio": {"train": 0.44},
    "mle_image": {"train": 0.64, "unseen": 0.71},
    "map_image": {"train": 0.71, "unseen": 0.75},
    "mle_full": {"train": 0.80},
    "map_full": {"train": 0.85},
}
"""Success rates of the paper's table, in simulation: on training objects, and on its five new ones."""
PAPER_ATTEMPTS = 1000
LABELS = {
    "prior_sample": "h ~ p(h)",
    "prior_argmax": "argmax p(h)",
    "mle_success_ratio": "argmax p(S=1 \\| h)",
    "map_success_ratio": "argmax p(h \\| S=1)",
    "mle_image": "argmax p(S=1, i \\| h)",
    "map_image": "argmax p(h \\| S=1, i)",
    "mle_full": "argmax p(S=1, O, p_O, beta, mu \\| h)",
    "map_full": "argmax p(h \\| S=1, O, p_O, beta, mu)",
    "top_down": "top-down on the centroid (baseline)",
    "force_closure": "best of 100 from p(h) by force closure (baseline)",
    "plan": "the planner: best grasp within reach",
}
COMPARISONS = (
    ("map_image", "map_success_ratio", "what the image is worth"),
    ("map_full", "map_image", "what full observation would add"),
    ("map_image", "mle_image", "what the prior is worth, with the image"),
    ("map_image", "top_down", "over the first baseline"),
    ("map_image", "force_closure", "over the second baseline"),
    ("plan", "map_image", "what choosing by reach adds"),
)


def summarize(results: Sequence[SceneResult], skipped: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The content of the JSON file: ``strategies`` by name, paired ``differences``, and what was ``skipped``."""
    present = [name for name in STRATEGIES if any(name in result.trials for result in results)]
    return {
        "scenes": len(results),
        "strategies": {name: _strategy(name, results) for name in present},
        "differences": [_difference(*pair, results) for pair in COMPARISONS if set(pair[:2]) <= set(present)],
        "skipped": dict(skipped or {}),
    }


def markdown(summary: Mapping[str, Any], split: str = "train") -> str:
    """The table against the paper's, the differences, and what was skipped."""
    paper = "unseen" if split == "unseen" else "train"
    lines = [
        "| strategy | | paper | success | 95 % | holds | 95 % | n | unreachable | no plan | s / plan |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
        *(_row(name, entry, paper) for name, entry in summary["strategies"].items()),
    ]
    promises = {name: entry["promises"] for name, entry in summary["strategies"].items() if entry.get("promises")}
    lines += [line for name, kept in promises.items() for line in _promise_lines(name, kept)]
    if summary["differences"]:
        lines += ["", "| paired difference | points | 95 % | n |", "|---|---:|---:|---:|"]
        lines += [_difference_row(entry) for entry in summary["differences"]]
    lines += [""] * bool(summary["skipped"])
    lines += [f"* `{name}` skipped: {reason}." for name, reason in summary["skipped"].items()]
    return "\n".join(lines) + "\n"


def markdown_per_object(summary: Mapping[str, Any]) -> str:
    """Success rates by object (rows) and strategy (columns), in percent."""
    strategies = summary["strategies"]
    names = sorted({name for entry in strategies.values() for name in entry["per_object"]})
    lines = [
        f"| object | n | {' | '.join(strategies)} |",
        f"|---|---:|{'---:|' * len(strategies)}",
    ]
    for name in names:
        cells = [entry["per_object"].get(name) for entry in strategies.values()]
        count = max(cell["attempts"] for cell in cells if cell)
        rates = " | ".join(f"{100 * cell['success_rate']:.0f}" if cell else "-" for cell in cells)
        lines.append(f"| {name} | {count} | {rates} |")
    return "\n".join(lines) + "\n"


def _strategy(name: str, results: Sequence[SceneResult]) -> dict[str, Any]:
    mine = [(result.object, result.trials[name]) for result in results if name in result.trials]
    by_object: dict[str, list[Trial]] = {}
    for object_id, trial in mine:
        by_object.setdefault(object_id, []).append(trial)
    return {
        **rates([trial for _, trial in mine]),
        "seconds_per_plan": float(np.mean([trial.seconds for _, trial in mine])),
        "paper": PAPER.get(name),
        "promises": None if (kept := promises_of(trial for _, trial in mine)) is None else kept.to_dict(),
        "per_object": {object_id: rates(trials) for object_id, trials in sorted(by_object.items())},
    }


def promises_of(trials: Iterable[Trial]) -> Promises | None:
    """What the trials promised beside what they delivered; None where too few of them say."""
    said = [(trial.promised, trial.success) for trial in trials if trial.promised is not None]
    if len(said) < PARTS:
        return None
    promised, success = map(np.array, zip(*said, strict=True))
    return keep_promises(promised, success)


def rates(trials: Sequence[Trial]) -> dict[str, Any]:
    """Rates of success and of holding, with intervals, and the counts of outcomes."""
    outcomes = Counter(trial.outcome for trial in trials)
    successes, holds = sum(trial.success for trial in trials), sum(trial.held for trial in trials)
    return {
        "attempts": len(trials),
        "success_rate": successes / len(trials),
        "interval": list(wilson(successes, len(trials))),
        "hold_rate": holds / len(trials),
        "hold_interval": list(wilson(holds, len(trials))),
        "unreachable": outcomes["unreachable"],
        "outcomes": dict(sorted(outcomes.items())),
    }


def _difference(first: str, second: str, meaning: str, results: Sequence[SceneResult]) -> dict[str, Any]:
    both = [r.trials for r in results if first in r.trials and second in r.trials]
    entry = {"first": first, "second": second, "meaning": meaning, "attempts": len(both)}
    if not both:
        return entry | {"difference": None, "interval": None}
    ones, others = (np.array([t[name].success for t in both]) for name in (first, second))
    mean, interval = paired_difference(ones, others)
    return entry | {"difference": mean, "interval": list(interval)}


def _row(name: str, entry: Mapping[str, Any], paper: str) -> str:
    low, high = entry["interval"]
    hold_low, hold_high = entry["hold_interval"]
    published = (entry["paper"] or {}).get(paper)
    cells = (
        f"`{name}`",
        LABELS[name],
        "-" if published is None else f"{100 * published:.3g} %",
        f"**{100 * entry['success_rate']:.1f} %**",
        f"{100 * low:.1f} - {100 * high:.1f}",
        f"{100 * entry['hold_rate']:.1f} %",
        f"{100 * hold_low:.1f} - {100 * hold_high:.1f}",
        str(entry["attempts"]),
        str(entry["unreachable"]),
        str(entry["outcomes"].get("no_plan", 0)),
        f"{entry['seconds_per_plan']:.3f}",
    )
    return f"| {' | '.join(cells)} |"


def _promise_lines(name: str, kept: Mapping[str, Any]) -> list[str]:
    """What a strategy promised and delivered, in all and by fifths of the promise."""
    parts = [("all", kept), *((f"fifth {number}", part) for number, part in enumerate(kept["fifths"], 1))]
    area = "-" if kept["auc"] is None else f"{kept['auc']:.2f}"
    return [
        "",
        f"| `{name}` (AUC of failure {area}) | promised | delivered | 95 % | n |",
        "|---|---:|---:|---:|---:|",
        *(
            f"| {label} | {100 * part['promised']:.1f} % | {100 * part['delivered']:.1f} % | "
            f"{100 * part['interval'][0]:.1f} - {100 * part['interval'][1]:.1f} | {part['count']} |"
            for label, part in parts
        ),
    ]


def _difference_row(entry: Mapping[str, Any]) -> str:
    name = f"`{entry['first']}` - `{entry['second']}`: {entry['meaning']}"
    if entry["difference"] is None or entry["interval"] is None:
        return f"| {name} | - | - | {entry['attempts']} |"
    low, high = entry["interval"]
    interval = f"{100 * low:+.1f} to {100 * high:+.1f}"
    return f"| {name} | {100 * entry['difference']:+.1f} | {interval} | {entry['attempts']} |"
