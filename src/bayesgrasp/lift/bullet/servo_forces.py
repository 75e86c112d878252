r"""Torques that servos, tendons and springs put on the joints of the robot, for engines that know none of them.

Everything in the model that pulls on joints does so linearly: its length is l = J q in the joint angles q, and a force
f along it is the torque J^T f. With the set-points u of the servos,

    servo    f = g u + b_0 + b_1 l + b_2 l', inside the servo's limits
    spring   f = k (l_0 - l)                 of a joint or a tendon
    damping  f = -d l'                       of a joint
    stop     f = K x - D l'                  while a tendon is beyond its stop by x

where every constant but K and D is the model's. The first three have one form and are evaluated as one. A tendon's stop
is a constraint in MuJoCo; here it is a spring as stiff as the engine's time step dt allows: with the tendon's effective
inertia m, K = m / (2 dt)^2 and D = m / (2 dt): it swings by half a radian a step, which explicit steps still follow,
and is damped by half of what is critical. (Stops of joints are left to the engine.)
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float64

Joints = Float64[np.ndarray, "joints"]
Pulls = Float64[np.ndarray, "pulls"]


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
        servos = np.array([_transmission(model, a, dofs, tendons) for a in range(model.nu)])
        self._servos = len(servos)
        self._pulls = np.concatenate([servos, np.eye(len(joints)), tendons])
        springs = np.concatenate([model.jnt_stiffness[joints], model.tendon_stiffness])
        rest = np.concatenate([model.qpos_spring[model.jnt_qposadr[joints]], model.tendon_lengthspring[:, 0]])
        damping = np.concatenate([model.dof_damping[dofs], model.tendon_damping])
        self._constant = np.concatenate([model.actuator_biasprm[:, 0], springs * rest])
        self._stiffness = np.concatenate([-model.actuator_biasprm[:, 1], springs])
        self._damping = np.concatenate([-model.actuator_biasprm[:, 2], damping])
        self._gain = model.actuator_gainprm[:, 0].copy()
        unlimited = np.full(len(springs), np.inf)
        self._least = np.concatenate([model.actuator_forcerange[:, 0], -unlimited])
        self._most = np.concatenate([model.actuator_forcerange[:, 1], unlimited])
        self._set_stops(model, time_step)

    def _set_stops(self, model: mujoco.MjModel, time_step: float) -> None:
        """Tendons are the last of the pulls."""
        stopped = np.flatnonzero(model.tendon_limited)
        self._stopped = len(self._pulls) - model.ntendon + stopped
        self._low, self._high = model.tendon_range[stopped].T.copy()
        inertia = 1.0 / model.tendon_invweight0[stopped]
        self._stop_stiffness = 0.25 * inertia / time_step**2
        self._stop_damping = 0.5 * inertia / time_step

    def act(self, q: Joints, speed: Joints, targets: Float64[np.ndarray, "servos"]) -> tuple[Joints, Pulls]:
        """Torques on the joints, N m, and the forces of the servos.

        Args:
            q: Angles, radians.
            speed: Their rates, rad/s.
            targets: Set-points of the servos.
        """
        length, rate = self._pulls @ q, self._pulls @ speed
        force = self._constant - self._stiffness * length - self._damping * rate
        force[: self._servos] += self._gain * targets
        force = np.minimum(np.maximum(force, self._least), self._most)
        force[self._stopped] += self._stop_force(length[self._stopped], rate[self._stopped])
        return force @ self._pulls, force[: self._servos]

    def _stop_force(self, length: Pulls, rate: Pulls) -> Pulls:
        beyond = np.minimum(np.maximum(length, self._low), self._high) - length
        force: Pulls = (beyond != 0.0) * (self._stop_stiffness * beyond - self._stop_damping * rate)
        return force


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
        weights: Joints = tendons[target]
    else:
        weights = (dofs == model.jnt_dofadr[target]).astype(np.float64)
    return weights
