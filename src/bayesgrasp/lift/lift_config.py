"""All parameters of the lift test, and which of them outcomes depend on."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal, get_args

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.lift.bullet.bullet_engine import BulletConfig
from bayesgrasp.lift.execution import LiftConfig
from bayesgrasp.lift.hold import HoldConfig
from bayesgrasp.robot.motion import MotionConfig
from bayesgrasp.robot.physics_scene import PhysicsConfig

EngineName = Literal["mujoco", "pybullet"]
Criterion = Literal["lift", "hold"]


@dataclass(frozen=True)
class LiftTestConfig:
    """All parameters of the lift test; what outcomes depend on is stored with every data set made by it.

    Attributes:
        motion: Of arm and hand.
        lift: Timing and criterion.
        physics: Numerics of MuJoCo.
        engine: Physics of attempts that screening cannot decide; PyBullet is an optional extra.
        criterion: What SUCCESS means: that the object was lifted, or that it was also held against pushes.
        hold: These pushes.
        bullet: Numerics of PyBullet.

    Raises:
        InvalidConfigurationError: No such engine or criterion.
    """

    motion: MotionConfig = field(default_factory=MotionConfig)
    lift: LiftConfig = field(default_factory=LiftConfig)
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    engine: EngineName = "mujoco"
    criterion: Criterion = "lift"
    hold: HoldConfig = field(default_factory=HoldConfig)
    bullet: BulletConfig = field(default_factory=BulletConfig)

    def __post_init__(self) -> None:
        for name, value, valid in (
            ("engine", self.engine, get_args(EngineName)),
            ("criterion", self.criterion, get_args(Criterion)),
        ):
            if value not in valid:
                raise InvalidConfigurationError(f"{name} must be one of {', '.join(valid)}, got {value!r}")

    def settings(self) -> dict[str, Any]:
        """What outcomes depend on, for the identity of a data set.

        An engine or criterion other than the default is named with its settings; a data set that names none was made
        by MuJoCo, with the lift as criterion.
        """
        settings = asdict(self)
        if self.engine == "mujoco":
            del settings["engine"], settings["bullet"]
        if self.criterion == "lift":
            del settings["criterion"], settings["hold"]
        return settings
