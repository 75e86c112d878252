"""``bayesgrasp plan``: from one depth image to grasps, their posterior, and a picture."""

from __future__ import annotations

from pathlib import Path

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.files import check_target, write_json
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.planning.figure import save_plan_figure
from bayesgrasp.planning.plan import Plan
from bayesgrasp.workflows.load import load_planner

FIGURE_SAMPLES = 2000
"""Draws behind the marginals of a figure."""


def plan(
    depth: Path,
    camera: Path,
    model: Path | None = None,
    top: int = 5,
    samples: int = 0,
    seed: int = 0,
    json: Path | None = None,
    figure: Path | None = None,
) -> None:
    """Plan grasps from a depth image.

    Prints the ranked grasps that the arm can reach, or the reason why there is none.

    Args:
        depth: Depth image: 16-bit PNG (millimetres), or .npy or .npz; 0 = no return.
        camera: Camera file: JSON with `intrinsics` and, if known, `camera_to_world`.
        model: Directory of a trained model; by default the one that comes with the package.
        top: How many grasps.
        samples: How many draws from the posterior; 0 for none (2000 for a figure).
        seed: Same seed, same plan.
        json: Write the plan to this file.
        figure: Draw the plan into this file (.png, .pdf or .svg).
    """
    _check_outputs(json, figure)
    view = Camera.load(camera)
    image = read_depth(depth)
    planner = load_planner(model)
    answer = planner.plan(image, view, top=top, samples=samples or (FIGURE_SAMPLES if figure else 0), seed=seed)
    print(describe(answer))
    if json is not None:
        write_json(json, answer.to_dict())
    if figure is not None:
        save_plan_figure(figure, answer, image, view, planner.robot.hand)


def describe(plan: Plan) -> str:
    """A plan in words: a line per grasp, warnings, the time."""
    lines = [f"warning: {warning}" for warning in plan.warnings]
    if plan.reason is not None:
        lines.append(f"no grasp: {plan.reason}")
    for rank, grasp in enumerate(plan.grasps, 1):
        x, y, z = grasp.hand_to_world[:3, 3]
        lines.append(
            f"{rank}. {grasp.grasp_type.name.lower():5} palm at ({x:+.3f}, {y:+.3f}, {z:+.3f}) m, "
            f"log posterior {grasp.log_posterior:.2f}, estimated success {100 * grasp.success_probability:.0f} %"
        )
    stages = ", ".join(f"{name} {ms:.0f}" for name, ms in plan.timings_ms.items() if name != "total")
    return "\n".join([*lines, f"planned in {plan.timings_ms['total']:.0f} ms ({stages})"])


def _check_outputs(json: Path | None, figure: Path | None) -> None:
    """Refuse before the work, not after it."""
    for path in (json, figure):
        if path is not None:
            check_target(path)
    if figure is not None and figure.suffix not in (".png", ".pdf", ".svg"):
        raise InvalidConfigurationError(f"a figure ends in .png, .pdf or .svg, got {figure}")
