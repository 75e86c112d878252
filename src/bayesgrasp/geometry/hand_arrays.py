"""The one door between the hands of learning and inference and the rows of simulators and files.

`Hands` are torch tensors with rotation matrices; `Attempts` are float32 arrays with quaternions. Quaternions are
computed in the precision of the hands and rounded to float32, so a hand is stored as the same bits whoever stores it.
"""

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from bayesgrasp.geometry import so3
from bayesgrasp.types import Attempts, Hands, Nuisances, Scenes


def attempts_of(hands: Hands, scenes: Scenes, nuisances: Nuisances) -> Attempts:
    """Each hand, in the order of its batch, in the scene and with the nuisances of the same row."""
    return Attempts(
        position=hands.position.reshape(-1, 3).float().numpy(),
        quaternion=so3.matrix_to_quaternion(hands.rotation).reshape(-1, 4).float().numpy(),
        grasp_type=hands.grasp_type.reshape(-1).numpy().astype(np.uint8),
        **scenes.columns(),
        **nuisances.columns(),
    )


def hands_of(attempts: Attempts) -> Hands:
    """The hands of attempts, float32."""
    return hands_from(attempts.position, attempts.quaternion, attempts.grasp_type)


def hands_from(
    position: Float32[np.ndarray, "*batch 3"],
    quaternion: Float32[np.ndarray, "*batch 4"],
    grasp_type: UInt8[np.ndarray, "*batch"],
) -> Hands:
    """Hands of stored columns, float32. Padding has the quaternion 0, which becomes the identity."""
    q = torch.from_numpy(quaternion)
    norm = q.norm(dim=-1, keepdim=True)
    identity = torch.tensor([1.0, 0.0, 0.0, 0.0])
    rotation = so3.quaternion_to_matrix(torch.where(norm > 0, q / norm.clamp(min=1e-12), identity))
    return Hands(torch.from_numpy(position), rotation, torch.from_numpy(grasp_type.astype(np.int64)))
