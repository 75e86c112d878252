"""The picture of a plan: the hand in the depth image, and the marginals of the posterior (paper, posterior figure).

Left to right: the depth image with the best grasp; the posterior of the position, p(x | S=1, i), above the measured
surface; the posterior of the rotation, p(R | S=1, i), as the three axes of the hand on the unit sphere (x red, y green,
z blue); the posterior of the grasp type, p(g | S=1, i), above those of the three coordinates. All in the world frame.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]
from scipy.spatial import ConvexHull, QhullError

from bayesgrasp.files import write_through
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.planning.observing import Observed
from bayesgrasp.planning.plan import Grasp, Plan
from bayesgrasp.posterior.marginals import Histogram, Marginals, marginals_of
from bayesgrasp.robot.open_hand import OpenHand
from bayesgrasp.types import GraspType, Hands

AXIS_COLORS = ("tab:red", "tab:green", "tab:blue")
DOTS = 120
"""Of a figure, an inch."""
MOST_DOTS = 2000
"""More draws than this are thinned in the clouds."""


def save_plan_figure(
    path: Path, plan: Plan, depth: Float[np.ndarray, "h w"], camera: Camera, hand: OpenHand, title: str = ""
) -> None:
    """Draw a plan into a file, whose suffix chooses the format; the other arguments as for `plan_figure`."""
    figure = plan_figure(plan, depth, camera, hand, title)
    write_through(path, lambda file: figure.savefig(file, format=path.suffix.lstrip("."), dpi=DOTS))


def plan_figure(plan: Plan, depth: Float[np.ndarray, "h w"], camera: Camera, hand: OpenHand, title: str = "") -> Figure:
    """A plan as a figure.

    Args:
        plan: With samples, else the marginals stay empty.
        depth: The user's depth image, metres.
        camera: The user's camera.
        hand: The open hand that is drawn.
        title: Above the image; by default what the best grasp is, or why there is none.
    """
    figure = Figure(figsize=(17, 4.6), layout="constrained")
    grid = figure.add_gridspec(1, 4, width_ratios=(1.5, 1.05, 1.0, 0.55), wspace=0.06)
    draw_grasps(figure.add_subplot(grid[0]), plan, depth, camera, hand, title)
    hands = None if plan.samples is None else plan.samples.hands
    marginals = None if hands is None or plan.posterior is None else marginals_of(hands, plan.posterior.region)
    _draw_positions(figure.add_subplot(grid[1], projection="3d"), plan.observed, hands)
    _draw_axes(figure.add_subplot(grid[2], projection="3d"), hands)
    right = grid[3].subgridspec(2, 1)
    _draw_types(figure.add_subplot(right[0]), marginals)
    _draw_coordinates(figure.add_subplot(right[1]), marginals)
    return figure


def draw_grasps(
    axes: Axes, plan: Plan, depth: Float[np.ndarray, "h w"], camera: Camera, hand: OpenHand, title: str = ""
) -> None:
    """The depth image with the best grasp in it, and the palms and approach directions of the others."""
    low, high = _depth_range(plan, depth)
    image = axes.imshow(np.where(depth > 0, depth, np.nan), cmap="viridis_r", vmin=low, vmax=high)
    axes.figure.colorbar(image, ax=axes, shrink=0.75).ax.set_title("depth (m)", fontsize="medium", loc="left")
    for grasp in plan.grasps[1:]:
        _draw_arrow(axes, grasp, camera, hand)
    if plan.grasps:
        _draw_hand(axes, plan.grasps[0], camera, hand)
    axes.set(xlim=(-0.5, depth.shape[1] - 0.5), ylim=(depth.shape[0] - 0.5, -0.5), xticks=[], yticks=[])
    axes.set_title(title or _headline(plan), fontsize=10, wrap=True)


def _depth_range(plan: Plan, depth: Float[np.ndarray, "h w"]) -> tuple[float, float]:
    """Depths of the workspace, so that its objects show; of the whole image where nothing of it is seen."""
    observed = plan.observed
    to_camera = np.linalg.inv(observed.camera_to_world) @ observed.workspace_to_world
    seen = observed.surface.near(0.2) @ to_camera[2, :3] + to_camera[2, 3]
    seen = seen if len(seen) else depth[depth > 0]
    low, high = np.percentile(seen, (0.5, 99.5)) if len(seen) else (0.0, 1.0)
    return float(low) - 0.02, float(high)


def _headline(plan: Plan) -> str:
    if not plan.grasps:
        return plan.reason or ""
    best = plan.grasps[0]
    return f"{best.grasp_type.name.lower()} grasp, log posterior {best.log_posterior:.1f}, {best.chance}"


def _draw_hand(axes: Axes, grasp: Grasp, camera: Camera, hand: OpenHand) -> None:
    """Outlines of the hand's shapes, farthest first, shaded by depth."""
    outlines = []
    for placed in hand.shapes[grasp.grasp_type]:
        corners = placed.corners() @ grasp.hand_to_camera[:3, :3].T + grasp.hand_to_camera[:3, 3]
        if (corners[:, 2] < 0.05).any():
            continue
        pixels, depths = camera.camera_to_pixels(corners)
        outlines.append((float(depths.mean()), _hull(pixels)))
    for _, outline in sorted(outlines, key=lambda item: -item[0]):
        axes.add_patch(Polygon(outline, facecolor=(0.95, 0.95, 0.95, 0.25), edgecolor="tab:red", linewidth=1.2))
    _draw_arrow(axes, grasp, camera, hand, color="tab:red")


def _draw_arrow(axes: Axes, grasp: Grasp, camera: Camera, hand: OpenHand, color: str = "white") -> None:
    """From the palm along the approach axis to the middle of the closing region."""
    tip = np.array([[0.0, 0.0, 0.0], [hand.gripper.closing_depth, 0.0, 0.0]])
    ends = tip @ grasp.hand_to_camera[:3, :3].T + grasp.hand_to_camera[:3, 3]
    if (ends[:, 2] < 0.05).any():
        return
    pixels, _ = camera.camera_to_pixels(ends)
    axes.annotate("", pixels[1], pixels[0], arrowprops={"arrowstyle": "->", "color": color, "lw": 1.6})


def _hull(pixels: np.ndarray) -> np.ndarray:
    try:
        return pixels[ConvexHull(pixels).vertices]
    except QhullError:  # seen exactly edge-on
        return pixels


def _draw_positions(axes: Axes3D, observed: Observed, hands: Hands | None) -> None:
    for points, color in ((observed.surface.near(0.2), "0.75"), (observed.surface.item_points, "0.2")):
        few = observed.in_world(points[:: 1 + len(points) // 1500])
        axes.scatter(*few.T, s=2, c=color, alpha=0.6, linewidths=0, depthshade=False)
    if hands is not None:
        chosen = _thin(hands)
        colors = matplotlib.colormaps["Dark2"](chosen.grasp_type.numpy())
        axes.scatter(*chosen.position.numpy().T, s=9, c=colors, alpha=0.5, linewidths=0, depthshade=False)
    axes.set(xlim=(-0.2, 0.2), ylim=(-0.2, 0.2), zlim=(0, 0.4), xlabel="x (m)", ylabel="y (m)", zlabel="z (m)")
    axes.set(xticks=(-0.2, 0, 0.2), yticks=(-0.2, 0, 0.2), zticks=(0, 0.2, 0.4))
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=35)
    axes.tick_params(labelsize=7)
    axes.set_title("p(x | S=1, i), by type", fontsize=10)


def _draw_axes(axes: Axes3D, hands: Hands | None) -> None:
    around, up = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    sphere = np.cos(around) * np.sin(up), np.sin(around) * np.sin(up), np.cos(up)
    axes.plot_wireframe(*sphere, color="0.85", linewidth=0.4)
    if hands is not None:
        chosen = _thin(hands)
        for axis, color in enumerate(AXIS_COLORS):
            axes.scatter(*chosen.rotation[:, :, axis].numpy().T, s=9, c=color, alpha=0.4, linewidths=0)
    for axis, color in enumerate(AXIS_COLORS):
        axes.text2D(0.03 + 0.07 * axis, 0.88, "xyz"[axis], color=color, transform=axes.transAxes, fontweight="bold")
    ends = (-1, 0, 1)
    axes.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-1, 1), xlabel="x", ylabel="y", zlabel="z")
    axes.set(xticks=ends, yticks=ends, zticks=ends)
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=22, azim=35)
    axes.tick_params(labelsize=7)
    axes.set_title("p(R | S=1, i): axes of the hand", fontsize=10)


def _draw_types(axes: Axes, marginals: Marginals | None) -> None:
    names = [t.name.lower() for t in GraspType]
    share = np.zeros(len(names)) if marginals is None else marginals.grasp_type
    axes.bar(names, share, color=matplotlib.colormaps["Dark2"](np.arange(len(names))))
    axes.set(ylim=(0, 1), ylabel="probability")
    axes.set_title("p(g | S=1, i)", fontsize=10)


def _draw_coordinates(axes: Axes, marginals: Marginals | None) -> None:
    if marginals is not None:
        for name, color in zip("xyz", AXIS_COLORS, strict=True):
            histogram: Histogram = getattr(marginals, name)
            axes.stairs(histogram.density, histogram.edges, color=color, label=name)
        axes.legend(fontsize=7, frameon=False)
    axes.set(xlabel="m", ylabel="1 / m")
    axes.set_title("p(x | S=1, i), by axis", fontsize=10)


def _thin(hands: Hands) -> Hands:
    return hands[:: 1 + len(hands.grasp_type) // MOST_DOTS]
