"""A sheet of a data set's images with their successful hands drawn in, for a person to look at."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from matplotlib import colormaps
from PIL import Image, ImageDraw

from bayesgrasp.data.loader import GraspDataset
from bayesgrasp.data.schema import Batch
from bayesgrasp.geometry.camera import IMAGE_SHAPE, Camera, canonical_camera
from bayesgrasp.geometry.camera_nuisances import disturbed_camera
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import CameraNuisances, GraspType, Hands, Outcome

ZOOM = 2
COLOURS = {GraspType.BASIC: (255, 80, 60), GraspType.WIDE: (70, 220, 90), GraspType.PINCH: (90, 150, 255)}
BEHIND, AHEAD, SPREAD = 0.06, 0.11, 0.055
"""Lengths drawn of a hand: behind and ahead of the palm, and to each side of the closing direction, metres."""


def draw_sheet(dataset: GraspDataset, columns: int = 4, rows: int = 4, most: int = 4, seed: int = 0) -> Image.Image:
    """Images chosen at random among those with a success, each with up to ``most`` of its successful hands.

    A hand is a line along its approach that ends at the palm, and a bar along its closing direction ahead of the palm,
    where the fingers meet the object; red basic, green wide, blue pinch. It is seen by the camera of its image.
    """
    rng = generator(seed, Stream.SHEET)
    successful = (dataset.scene_columns["hand_outcome"] == Outcome.SUCCESS).any(axis=1)
    candidates = np.flatnonzero(successful)
    chosen = np.sort(rng.permutation(candidates)[: columns * rows])
    height, width = IMAGE_SHAPE[0] * ZOOM, IMAGE_SHAPE[1] * ZOOM
    sheet = Image.new("RGB", (columns * width, rows * height))
    batch = dataset.scenes("all", shuffle=False).batch(chosen)
    for place in range(len(chosen)):
        label = f"{dataset.object_ids[int(batch.object_index[place])]} x{float(batch.scale[place]):.2f}"
        picture = draw_scene(batch, place, camera_of(dataset, int(chosen[place])), most, label)
        sheet.paste(picture, (place % columns * width, place // columns * height))
    return sheet


def camera_of(dataset: GraspDataset, row: int) -> Camera:
    """The camera that a scene is seen by: as its nuisances made it, or the one that its image was drawn again from."""
    if dataset.manifest.cameras == "any":
        return canonical_camera()
    names = CameraNuisances.__dataclass_fields__
    nuisances = {name: dataset.scene_columns[f"camera_{name}"][row : row + 1] for name in names}
    return disturbed_camera(canonical_camera(), CameraNuisances(**nuisances), 0)


def draw_scene(batch: Batch, place: int, camera: Camera, most: int, label: str) -> Image.Image:
    """One image of a batch with some of its successful hands."""
    picture = Image.fromarray(shade(batch.images[place, 0].numpy())).resize(
        (IMAGE_SHAPE[1] * ZOOM, IMAGE_SHAPE[0] * ZOOM), Image.Resampling.NEAREST
    )
    pen = ImageDraw.Draw(picture)
    for index in torch.nonzero(batch.success[place] > 0)[:, 0][:most].tolist():
        _draw_hand(pen, batch.hands[place, index], camera)
    pen.text((6, 4), label, fill=(255, 255, 255))
    return picture


def shade(depth: Float32[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """Depth as colours, near bright; no return black."""
    valid = depth > 0
    low, high = (depth[valid].min(), depth[valid].max()) if valid.any() else (0.0, 1.0)
    colours = colormaps["viridis"](1 - (depth - low) / max(high - low, 1e-6))[..., :3]
    return (255 * np.where(valid[..., None], colours, 0)).astype(np.uint8)


def _draw_hand(pen: ImageDraw.ImageDraw, hand: Hands, camera: Camera) -> None:
    position, rotation = hand.position.double().numpy(), hand.rotation.double().numpy()
    approach, closing = rotation[:, 0], rotation[:, 1]
    tip = position + AHEAD * approach
    colour = COLOURS[GraspType(int(hand.grasp_type))]
    pen.line(_pixels(np.stack([position - BEHIND * approach, position]), camera), fill=colour, width=3)
    pen.line(_pixels(np.stack([position, tip]), camera), fill=colour, width=1)
    pen.line(_pixels(np.stack([tip - SPREAD * closing, tip + SPREAD * closing]), camera), fill=colour, width=3)


def _pixels(points: Float[np.ndarray, "n 3"], camera: Camera) -> list[tuple[float, float]]:
    """Places in the zoomed image of points in the world."""
    pixels, _ = camera.project(points)
    scale = np.array([IMAGE_SHAPE[1] / camera.width, IMAGE_SHAPE[0] / camera.height]) * ZOOM
    return [(float(u), float(v)) for u, v in (pixels + 0.5) * scale]
