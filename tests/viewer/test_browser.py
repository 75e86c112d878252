"""The viewer on a real server: what is in its scene follows the slider, the limits and the button."""

import urllib.request
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from box_scene import Box, box_depth_image
from untrained_model import save_untrained

from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.planning.selection import SelectionConfig
from bayesgrasp.types import GraspType
from bayesgrasp.viewer.browser import GraspViewer, Seen, open_server
from bayesgrasp.viewer.hand_mesh import open_hand_mesh
from bayesgrasp.workflows.load import PlannerConfig, load_planner


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GraspViewer]:
    config = PlannerConfig(selection=SelectionConfig(least_success=0.0))
    planner = load_planner(save_untrained(tmp_path_factory.mktemp("viewer") / "model"), config=config)
    camera = canonical_camera()
    scenes = [Seen(box_depth_image(camera, boxes), camera) for boxes in ((Box(x=0.02),), ())]
    server = open_server("127.0.0.1", 0)
    yield GraspViewer(server, planner, iter(scenes))
    server.stop()


def node(viewer: GraspViewer, name: str) -> Any:
    return viewer.server.scene._handle_from_node_name.get(name)


def test_the_scene_follows_the_controls(viewer: GraspViewer) -> None:
    with urllib.request.urlopen(f"http://127.0.0.1:{viewer.server.get_port()}", timeout=60) as page:
        assert b"<html" in page.read()
    grasps = viewer.plan.grasps
    assert len(grasps) > 1
    assert node(viewer, "/points").points.shape[1] == 3
    assert any(node(viewer, f"/draws/{kind.name.lower()}") for kind in GraspType)
    for rank in (2, 1):
        viewer.rank.value = rank
        viewer.show()
        np.testing.assert_allclose(node(viewer, "/grasp").position, grasps[rank - 1].hand_to_world[:3, 3], atol=1e-6)
        assert f"**{rank} of {len(grasps)}:**" in viewer.words.content
    viewer.draws.value = False
    viewer.show()
    assert not any(node(viewer, f"/draws/{kind.name.lower()}") for kind in GraspType)

    viewer.types[GraspType.BASIC].value = False
    viewer.replan()
    assert GraspType.BASIC not in {grasp.grasp_type for grasp in viewer.plan.grasps}
    viewer.keep_out.value = True
    viewer.replan()
    assert node(viewer, "/keep_out") is not None
    viewer.low.value = (1.0, 1.0, 1.0)
    viewer.replan()
    assert "**error:** box needs low < high" in viewer.words.content
    viewer.keep_out.value = False
    viewer.take_next()
    assert node(viewer, "/grasp") is None
    assert "**no grasp:** nothing on the table" in viewer.words.content


def test_the_hand_is_its_shapes(viewer: GraspViewer) -> None:
    hand = viewer.planner.robot.hand
    for kind in GraspType:
        vertices, faces = open_hand_mesh(hand, kind)
        assert faces.max() == len(vertices) - 1
        np.testing.assert_allclose(hand.distance(vertices.astype(np.float64), kind).max(), 0.0, atol=2e-3)
