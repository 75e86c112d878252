"""Promises of plans beside what they delivered."""

import numpy as np
import pytest

from bayesgrasp.diagnostics.promises import keep_promises
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.seeding import generator


def test_kept_promises() -> None:
    rng = generator(0)
    promised = rng.uniform(0.5, 1.0, 20_000)
    kept = keep_promises(promised, rng.random(20_000) < promised)
    assert kept.overall.promised == pytest.approx(0.75, abs=0.01)
    assert kept.overall.delivered == pytest.approx(0.75, abs=0.01)
    for part, middle in zip(kept.parts, (0.55, 0.65, 0.75, 0.85, 0.95), strict=True):
        assert part.count == 4000
        assert part.promised == pytest.approx(middle, abs=0.01)
        assert part.delivered == pytest.approx(middle, abs=0.015)
        assert part.interval[0] < part.delivered < part.interval[1]


def test_risk_falls_where_promises_tell_failures_apart() -> None:
    promised = np.linspace(0.1, 1.0, 100)
    kept = keep_promises(promised, promised > 0.55)
    assert kept.auc == 1.0
    assert kept.risk[49] == 0.0
    assert kept.risk[-1] == 0.5
    assert (np.diff(kept.risk[50:]) > 0).all()
    assert kept.coverage[-1] == 1.0
    assert "AUC of failure 1.00" in str(kept)


def test_without_failures_nothing_can_be_told_apart() -> None:
    kept = keep_promises(np.linspace(0.5, 1, 10), np.ones(10, bool))
    assert kept.to_dict()["auc"] is None
    assert kept.draw().axes[1].lines[0].get_ydata().max() == 0.0


@pytest.mark.parametrize("promised", [[0.5] * 4, [0.5] * 9 + [1.5], [0.5] * 9 + [np.nan]])
def test_what_cannot_be_judged_is_refused(promised) -> None:
    with pytest.raises(InvalidConfigurationError, match="promises between 0 and 1"):
        keep_promises(np.array(promised), np.ones(len(promised), bool))
