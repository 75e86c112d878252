r"""Torques that servos, tendons and springs put on the joints of the robot, for engines that know none of them.

All transmissions of the model are linear in the joint angles q: a servo or tendon has length l = J q, and a force f
along it is the torque J^T f. With the set-points u,

    servo    f = clip(g u + b_0 + b_1 l + b_2 l', limits)
    spring   f = k (l_0 - l)            of a joint or a tendon, inside its slack [l_0-, l_0+]
    stop     f = K x - D l'             while a tendon is beyond its stop by x
    damping  f = -d q'

where every constant but K and D is the model's. A stop in MuJoCo is a constraint; here it is a spring as stiff as the
engine's time step dt allows: with the tendon's effective inertia m, K = m / (2 dt)^2 and D = m / (2 dt).
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float64

Joints = Float64[np.ndarray, "joints"]


class ServoForces:
    """Torques as a function of the robot's state.

    Args:
        model: Its hinges, servos and tendons.
        joints: Which joints of the model, in the order of q.
        time_step: Of the engine that applies the torques, seconds.
    """

    def __init__(self, model: mujoco.MjModel, joints: list[int], time_step: float) -> None:
        dofs = model.jnt_dofadr[joints]
        tendons = _tendon_lengths(model)[:, dofs]
        self._transmission = np.array([_transmission(model, a, dofs, tendons) for a in range(model.nu)])
        self._gain = model.actuator_gainprm[:, 0].copy()
        self._bias = model.actuator_biasprm[:, :3].T.copy()
        self._limits = model.actuator_forcerange.T.copy()
        self._damping = model.dof_damping[dofs].copy()
        sprung = model.tendon_stiffness > 0
        self._spring = np.concatenate([np.eye(len(joints)), tendons[sprung]])
        self._stiffness = np.concatenate([model.jnt_stiffness[joints], model.tendon_stiffness[sprung]])
        rest = model.qpos_spring[model.jnt_qposadr[joints]]
        self._slack = np.concatenate([np.stack([rest, rest], 1), model.tendon_lengthspring[sprung]]).T
        stopped = model.tendon_limited.astype(bool)
        self._stopped, self._stops = tendons[stopped], model.tendon_range[stopped].T.copy()
        inertia = 1.0 / model.tendon_invweight0[stopped]
        self._stop_stiffness = 0.25 * inertia / time_step**2
        self._stop_damping = 0.5 * inertia / time_step

    def __call__(self, q: Joints, speed: Joints, targets: Float64[np.ndarray, "servos"]) -> tuple[Joints, np.ndarray]:
        """Torques on the joints, N m, and the forces of the servos."""
        b0, b1, b2 = self._bias
        force = self._gain * targets + b0 + b1 * (self._transmission @ q) + b2 * (self._transmission @ speed)
        force = np.clip(force, *self._limits)
        length = self._spring @ q
        stretch = np.clip(length, *self._slack) - length
        torque = force @ self._transmission + (self._stiffness * stretch) @ self._spring - self._damping * speed
        return torque + self._stop_force(q, speed) @ self._stopped, force

    def _stop_force(self, q: Joints, speed: Joints) -> np.ndarray:
        length = self._stopped @ q
        beyond = np.clip(length, *self._stops) - length
        return np.where(
            beyond != 0.0, self._stop_stiffness * beyond - self._stop_damping * (self._stopped @ speed), 0.0
        )


def _tendon_lengths(model: mujoco.MjModel) -> Float64[np.ndarray, "tendons dofs"]:
    """d(length) / d(joint) of the fixed tendons."""
    lengths = np.zeros((model.ntendon, model.nv))
    for tendon in range(model.ntendon):
        for wrap in range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon]):
            lengths[tendon, model.jnt_dofadr[model.wrap_objid[wrap]]] += model.wrap_prm[wrap]
    return lengths


def _transmission(
    model: mujoco.MjModel, actuator: int, dofs: np.ndarray, tendons: Float64[np.ndarray, "tendons joints"]
) -> Joints:
    target = model.actuator_trnid[actuator, 0]
    if model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_TENDON:
        return tendons[target]
    return (dofs == model.jnt_dofadr[target]).astype(np.float64)
