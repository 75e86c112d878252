"""``bayesgrasp plan``: from one depth image to grasps, their posterior, and a picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from bayesgrasp.cli.endings import EXIT_NO_GRASP
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.files import check_target, write_json
from bayesgrasp.geometry.box import Box
from bayesgrasp.geometry.camera import Camera
from bayesgrasp.observation.depth_files import read_depth
from bayesgrasp.planning.constraints import EVERY_TYPE, Constraints
from bayesgrasp.planning.figure import save_plan_figure
from bayesgrasp.planning.plan import Plan
from bayesgrasp.planning.planner import PlannerConfig
from bayesgrasp.planning.selection import Rank, SelectionConfig
from bayesgrasp.posterior.samples_file import check_samples_target, write_samples
from bayesgrasp.types import GraspType
from bayesgrasp.workflows.load import load_planner

SHOWN_SAMPLES = 2000
"""Draws behind the marginals of a figure, or in a file, where no number is given."""
Corners = tuple[float, float, float, float, float, float]
"""Lower and upper corner of a box."""


@dataclass(frozen=True)
class Wanted:
    """What is asked for.

    Attributes:
        top: How many grasps.
        samples: How many draws from the posterior; 0 for none (2000 for a figure or a file of them).
        rank: What makes one grasp better than another: its probability of success, that of holding the object against
            pushes as well, or the posterior.
        seed: Same seed, same plan.
    """

    top: int = 5
    samples: int = 0
    rank: Rank = "success"
    seed: int = 0


@dataclass(frozen=True)
class Limits:
    """What the grasps must keep to.

    Attributes:
        types: Grasp types that may be used; all by default.
        lowest: No part of the open hand may be lower than this, metres above the table.
        keep_out: A box x0 y0 z0 x1 y1 z1 that the open hand must not enter, on the whole straight way to the grasp;
            metres, world frame. May be given several times.
        confidence: Only grasps that succeed at least at this rate, such as 0.95, by what plans of this model delivered
            on objects that it was not trained with; by default a grasp needs an estimated success of 50 %.
    """

    types: tuple[Literal["basic", "wide", "pinch"], ...] = ()
    lowest: float | None = None
    keep_out: tyro.conf.UseAppendAction[tuple[Corners, ...]] = ()
    confidence: float | None = None

    def constraints(self) -> Constraints:
        """The same for the planner."""
        boxes = tuple(Box((x0, y0, z0), (x1, y1, z1)) for x0, y0, z0, x1, y1, z1 in self.keep_out)
        types = tuple(GraspType[name.upper()] for name in self.types)
        return Constraints(boxes, self.lowest, types or EVERY_TYPE, self.confidence)


@dataclass(frozen=True)
class Outputs:
    """Files to write.

    Attributes:
        json: Write the plan to this file.
        figure: Draw the plan into this file (.png, .pdf or .svg).
        samples_out: Write draws from the posterior, as many as --samples, to this file (.npz or .json).
    """

    json: Path | None = None
    figure: Path | None = None
    samples_out: Path | None = None

    def check(self) -> None:
        """Refuse before the work, not after it."""
        if self.samples_out is not None:
            check_samples_target(self.samples_out)
        for path in (self.json, self.figure):
            if path is not None:
                check_target(path)
        if self.figure is not None and self.figure.suffix not in (".png", ".pdf", ".svg"):
            raise InvalidConfigurationError(f"a figure ends in .png, .pdf or .svg, got {self.figure}")


def plan(
    depth: Path,
    camera: Path,
    model: Path | None = None,
    device: str = "cpu",
    refine_pose: bool = False,
    wanted: Annotated[Wanted, tyro.conf.OmitArgPrefixes] = Wanted(),
    limits: Annotated[Limits, tyro.conf.OmitArgPrefixes] = Limits(),
    outputs: Annotated[Outputs, tyro.conf.OmitArgPrefixes] = Outputs(),
) -> None:
    """Plan grasps from a depth image.

    Prints the ranked grasps that the arm can reach. Where there is none, prints the reason and ends with exit code 3.

    Args:
        depth: Depth image: 16-bit PNG (millimetres), or .npy or .npz; 0 = no return.
        camera: Camera file: JSON with `intrinsics` and, if known, `camera_to_world`.
        model: Directory of a trained model; by default the one that comes with the package.
        device: Where to compute: cpu, cuda, or cuda:N.
        refine_pose: Correct tilt and height of the camera's stated pose by the table that it sees.
        wanted: What is asked for.
        limits: What the grasps must keep to.
        outputs: Files to write.
    """
    outputs.check()
    constraints = limits.constraints()
    view = Camera.load(camera)
    image = read_depth(depth)
    config = PlannerConfig(selection=SelectionConfig(rank=wanted.rank))
    planner = load_planner(model, device=device, config=config)
    planner = planner.refining_pose() if refine_pose else planner
    samples = wanted.samples or (SHOWN_SAMPLES if outputs.figure or outputs.samples_out else 0)
    answer = planner.plan(image, view, top=wanted.top, samples=samples, constraints=constraints, seed=wanted.seed)
    print(describe(answer))
    if outputs.json is not None:
        write_json(outputs.json, answer.to_dict())
    if outputs.figure is not None:
        save_plan_figure(outputs.figure, answer, image, view, planner.robot.hand)
    if outputs.samples_out is not None and answer.samples is not None and answer.posterior is not None:
        write_samples(outputs.samples_out, answer.samples, answer.posterior)
    if not answer.grasps:
        raise SystemExit(EXIT_NO_GRASP)


def describe(plan: Plan) -> str:
    """A plan in words: a line per grasp, warnings, the time."""
    lines = [f"warning: {warning}" for warning in plan.warnings]
    if plan.reason is not None:
        lines.append(f"no grasp: {plan.reason}")
    for rank, grasp in enumerate(plan.grasps, 1):
        x, y, z = grasp.hand_to_world[:3, 3]
        lines.append(
            f"{rank}. {grasp.grasp_type.name.lower():5} palm at ({x:+.3f}, {y:+.3f}, {z:+.3f}) m, "
            f"log posterior {grasp.log_posterior:.2f}, {grasp.chance}"
        )
    stages = ", ".join(f"{name} {ms:.0f}" for name, ms in plan.timings_ms.items() if name != "total")
    return "\n".join([*lines, f"planned in {plan.timings_ms['total']:.0f} ms ({stages})"])
