"""The command that shows a gripper."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bayesgrasp.cli.gripper import HANDS, show
from bayesgrasp.errors import InvalidConfigurationError


@pytest.mark.parametrize("name", HANDS)
def test_show_describes_and_draws(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show(name, tmp_path / "hand.png")
    out = capsys.readouterr().out
    hand = HANDS[name]()
    assert hand.name == name
    assert all(joint in out for joint in hand.joint_names)
    picture = np.asarray(Image.open(tmp_path / "hand.png")).astype(int)
    opened, closed = (np.roll(picture, -shift, axis=1)[:320, :320] for shift in (0, 2 * picture.shape[1] // 3))
    assert (np.abs(opened - closed).max(axis=-1) > 30).mean() > 0.01


def test_a_hand_of_another_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidConfigurationError, match="no gripper 'claw'; known: robotiq-3f, robotiq-2f-85"):
        show("claw", tmp_path / "hand.png")
    assert not (tmp_path / "hand.png").exists()
