"""A plan in the browser, by viser: the measured points, draws from the posterior as hands, and the ranked grasps.

Everything is in the world frame, metres. The hands of draws are see-through and coloured by grasp type (red basic,
green wide, blue pinch); the grasp that the slider chooses is solid. Types, the lowest height and a box to stay out of
are set by hand, and the plan is made again at once. All who look at one server see the same scene.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Float32
from scipy.spatial.transform import Rotation

from bayesgrasp.errors import BayesgraspError, InvalidConfigurationError
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.planning.constraints import EVERY_TYPE, Constraints
from bayesgrasp.planning.plan import Plan
from bayesgrasp.planning.planner import Planner
from bayesgrasp.viewer.hand_mesh import TYPE_COLORS, open_hand_mesh

try:
    import viser
except ImportError as missing:
    raise InvalidConfigurationError("the viewer needs an extra: pip install 'bayesgrasp[viewer]'") from missing

DRAWS, TOP = 60, 10
"""Hands of the posterior, and grasps on the slider."""
DOT = 0.002
"""Size of a measured point, metres."""
MOST_POINTS = 40_000


@dataclass(frozen=True, eq=False)
class Seen:
    """What is looked at.

    Attributes:
        depth: Depth image, metres, 0 = no return.
        camera: That took it.
    """

    depth: Float32[np.ndarray, "h w"]
    camera: Camera


def open_server(host: str, port: int) -> viser.ViserServer:
    """A server that a browser can look at; port 0 is any free one."""
    return viser.ViserServer(host, port, verbose=False)


class GraspViewer:
    """A scene and its controls on a server.

    Args:
        server: Of viser.
        planner: Who plans.
        scenes: What is looked at; the button takes the next one, where there is one.
    """

    def __init__(self, server: viser.ViserServer, planner: Planner, scenes: Iterator[Seen]) -> None:
        self.server, self.planner, self.scenes = server, planner, scenes
        self.seen = next(scenes)
        self.plan: Plan | None = None
        self._turn = threading.RLock()
        self._meshes = {kind: open_hand_mesh(planner.robot.hand, kind) for kind in EVERY_TYPE}
        gui = server.gui
        self.words = gui.add_markdown("")
        self.rank = gui.add_slider("grasp", min=1, max=TOP, step=1, initial_value=1)
        self.draws = gui.add_checkbox("draws from the posterior", True)
        self.types = {kind: gui.add_checkbox(kind.name.lower(), True) for kind in EVERY_TYPE}
        self.limit_height = gui.add_checkbox("lowest height", False)
        self.lowest = gui.add_number("height (m)", 0.0, min=-0.05, max=0.5, step=0.005)
        self.keep_out = gui.add_checkbox("stay out of a box", False)
        self.low = gui.add_vector3("lower corner (m)", (-0.4, -0.4, 0.0), step=0.01)
        self.high = gui.add_vector3("upper corner (m)", (0.4, -0.1, 0.5), step=0.01)
        self.next = gui.add_button("next scene")
        self._listen()
        self.replan()

    def _listen(self) -> None:
        self.rank.on_update(self._told(self.show))
        self.draws.on_update(self._told(self.show))
        limits: tuple[Any, ...] = (
            *self.types.values(),
            self.limit_height,
            self.lowest,
            self.keep_out,
            self.low,
            self.high,
        )
        for limit in limits:
            limit.on_update(self._told(self.replan))
        self.next.on_click(self._told(self.take_next))

    @staticmethod
    def _told(do: Callable[[], None]) -> Callable[[Any], None]:
        return lambda _: do()

    def take_next(self) -> None:
        """Look at the next scene; stay where there is none."""
        with self._turn:
            self.seen = next(self.scenes, self.seen)
            self.replan()

    def constraints(self) -> Constraints:
        """What the controls say.

        Raises:
            InvalidConfigurationError: No type is left, or the box is none.
        """
        types = tuple(kind for kind, chosen in self.types.items() if chosen.value)
        (x0, y0, z0), (x1, y1, z1) = self.low.value, self.high.value
        boxes = (Box((x0, y0, z0), (x1, y1, z1)),) if self.keep_out.value else ()
        return Constraints(boxes, self.lowest.value if self.limit_height.value else None, types)

    def replan(self) -> None:
        """Plan for the scene under the constraints, and show it; say what is wrong where that cannot be."""
        with self._turn:
            try:
                limits, seen = self.constraints(), self.seen
                self.plan = self.planner.plan(seen.depth, seen.camera, top=TOP, samples=DRAWS, constraints=limits)
            except BayesgraspError as error:
                self.words.content = f"**error:** {error}"
                return
            self.show()

    def show(self) -> None:
        """Draw the plan as the controls ask."""
        with self._turn:
            if self.plan is None:
                return
            with self.server.atomic():
                self.server.scene.reset()
                self._draw_points(self.plan)
                self._draw_draws(self.plan)
                self._draw_grasp(self.plan)
            self.words.content = self._describe(self.plan)

    def _draw_points(self, plan: Plan) -> None:
        depth, camera = self.seen.depth, self.seen.camera.with_pose(plan.observed.camera_to_world)
        points = (depth[..., None] * camera.rays())[depth > 0]
        points = points[:: 1 + len(points) // MOST_POINTS] @ camera.pose[:3, :3].T + camera.pose[:3, 3]
        self.server.scene.add_point_cloud("/points", points.astype(np.float32), (120, 120, 130), point_size=DOT)
        if self.keep_out.value:
            low, high = np.array(self.low.value), np.array(self.high.value)
            middle, size = (low + high) / 2, high - low
            self.server.scene.add_box("/keep_out", (250, 180, 40), size, opacity=0.3, position=middle)

    def _draw_draws(self, plan: Plan) -> None:
        if plan.samples is None or not self.draws.value:
            return
        hands = plan.samples.hands
        for kind, mesh in self._meshes.items():
            chosen = (hands.grasp_type == kind).numpy()
            if chosen.any():
                self.server.scene.add_batched_meshes_simple(
                    f"/draws/{kind.name.lower()}",
                    *mesh,
                    _quaternions(hands.rotation.numpy()[chosen]),
                    hands.position.numpy()[chosen],
                    batched_colors=TYPE_COLORS[kind],
                    opacity=0.1,
                )

    def _draw_grasp(self, plan: Plan) -> None:
        if not plan.grasps:
            return
        grasp = plan.grasps[min(self.rank.value, len(plan.grasps)) - 1]
        mesh = self._meshes[grasp.grasp_type]
        self.server.scene.add_mesh_simple(
            "/grasp",
            *mesh,
            color=TYPE_COLORS[grasp.grasp_type],
            flat_shading=True,
            wxyz=_quaternions(grasp.hand_to_world[None, :3, :3])[0],
            position=grasp.hand_to_world[:3, 3],
        )

    def _describe(self, plan: Plan) -> str:
        lines = [f"*{warning}*" for warning in plan.warnings]
        if not plan.grasps:
            return "\n\n".join([f"**no grasp:** {plan.reason}", *lines])
        rank = min(self.rank.value, len(plan.grasps))
        grasp = plan.grasps[rank - 1]
        return "\n\n".join(
            [f"**{rank} of {len(plan.grasps)}:** {grasp.grasp_type.name.lower()}, {grasp.chance}", *lines]
        )


def _quaternions(rotations: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 4"]:
    """(w, x, y, z)."""
    quaternions: np.ndarray = Rotation.from_matrix(rotations).as_quat(scalar_first=True)
    return quaternions
