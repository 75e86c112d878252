"""From a depth image and its camera, both in files, to grasps that the robot can execute.

    python examples/plan_on_an_image.py [DEPTH.png CAMERA.json]

Without files of your own, a simulated camera first takes a picture of a can. A depth file is a 16-bit PNG in
millimetres or a NumPy array; `docs/planning.md` shows a camera file.
"""

import sys
from pathlib import Path

import bayesgrasp as bg
from bayesgrasp.observation.depth_files import write_depth_png


def take_picture(depth: Path, camera: Path) -> None:
    """Write the files that a depth camera of your own would give."""
    situation = bg.SceneMaker(bg.load_objects(["household_drink_can"]), seed=0).make(0)
    write_depth_png(depth, situation.depth)
    bg.canonical_camera().save(camera)


def main(depth: Path, camera: Path) -> bg.Plan:
    """Plan, and say what came out.

    Args:
        depth: Depth image.
        camera: Intrinsics and, where it is known, the pose of the camera.
    """
    plan = bg.load().plan(bg.read_depth(depth), bg.Camera.load(camera))
    for warning in plan.warnings:
        print(f"warning: {warning}")
    if plan.reason is not None:
        print(f"no grasp: {plan.reason}")
    for number, grasp in enumerate(plan.grasps, start=1):
        x, y, z = grasp.hand_to_world[:3, 3]
        print(
            f"{number}. {grasp.grasp_type.name.lower():5} at ({x:+.3f}, {y:+.3f}, {z:.3f}) m, "
            f"success {100 * grasp.success_probability:.0f} %, {len(grasp.motion.transit)} waypoints to the pre-grasp"
        )
    return plan


if __name__ == "__main__":
    if len(sys.argv) == 1:
        take_picture(Path("depth.png"), Path("camera.json"))
        sys.argv += ["depth.png", "camera.json"]
    main(Path(sys.argv[1]), Path(sys.argv[2]))
