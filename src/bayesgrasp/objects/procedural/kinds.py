"""The kinds of things and how often each is drawn: the table behind p(O)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayesgrasp.objects.procedural import tools, toys, vessels
from bayesgrasp.objects.procedural.pieces import Draw, Pieces

Interval = tuple[float, float]
PACKED, PLASTIC, WOOD = (150.0, 1500.0), (300.0, 1300.0), (450.0, 1100.0)
WARE, METAL, FOOD = (1000.0, 2500.0), (1500.0, 7000.0), (600.0, 1100.0)
"""Densities, kg/m^3, of what is packed, of hollow and solid plastic, of wood, of ceramic and glass, of metal (with the
air that is in a tool), and of what is eaten."""


@dataclass(frozen=True)
class Kind:
    """One class of things.

    Attributes:
        make: Draws one, standing as it was made to stand.
        weight: How often, relative to the others.
        density: Interval, kg/m^3; uniform in the logarithm.
        lies: Share that lies on its side.
        upside_down: Share that is put down upside down.
    """

    make: Callable[[Draw], Pieces]
    weight: int
    density: Interval
    lies: float = 0.0
    upside_down: float = 0.0


KINDS: dict[str, Kind] = {
    "carton": Kind(vessels.carton, 5, PACKED),
    "cube": Kind(vessels.cube, 3, PLASTIC),
    "flat-box": Kind(vessels.flat_box, 4, PACKED, lies=0.1),
    "can": Kind(vessels.can, 4, (250.0, 2500.0), lies=0.25),
    "bottle": Kind(vessels.bottle, 5, (250.0, 1200.0), lies=0.3),
    "spray": Kind(vessels.spray, 2, (250.0, 1000.0), lies=0.4),
    "jar": Kind(vessels.jar, 2, (500.0, 1500.0), lies=0.15),
    "tumbler": Kind(vessels.tumbler, 3, WARE, lies=0.2, upside_down=0.2),
    "mug": Kind(vessels.mug, 3, WARE, lies=0.15, upside_down=0.15),
    "bowl": Kind(vessels.bowl, 3, WARE, upside_down=0.2),
    "plate": Kind(vessels.plate, 2, WARE, upside_down=0.15),
    "goblet": Kind(vessels.goblet, 2, WARE, lies=0.2, upside_down=0.2),
    "tray": Kind(vessels.tray, 2, PLASTIC, upside_down=0.2),
    "basket": Kind(vessels.basket, 2, PLASTIC),
    "pan": Kind(vessels.pan, 2, METAL, upside_down=0.2),
    "pot": Kind(vessels.watering_can, 2, (300.0, 1500.0), lies=0.1),
    "hammer": Kind(tools.hammer, 2, METAL),
    "screwdriver": Kind(tools.screwdriver, 3, (900.0, 3000.0)),
    "wrench": Kind(tools.wrench, 2, METAL),
    "pliers": Kind(tools.pliers, 2, METAL),
    "spoon": Kind(tools.spoon, 2, PLASTIC, upside_down=0.3),
    "knife": Kind(tools.knife, 2, (900.0, 4000.0), lies=0.1),
    "pen": Kind(tools.pen, 3, PLASTIC),
    "stick": Kind(tools.stick, 3, WOOD),
    "torch": Kind(tools.torch, 2, (400.0, 2500.0)),
    "drill": Kind(tools.drill, 2, (800.0, 2500.0)),
    "clamp": Kind(tools.clamp, 2, METAL, lies=0.1),
    "spool": Kind(tools.spool, 3, WOOD, lies=0.4),
    "nut": Kind(tools.nut, 2, METAL, lies=0.3),
    "loop": Kind(tools.loop, 2, PLASTIC, lies=0.1),
    "handle": Kind(tools.handle, 2, (500.0, 3000.0), lies=0.15),
    "cross": Kind(tools.cross, 2, PLASTIC),
    "elbow": Kind(tools.pick, 2, METAL),
    "ball": Kind(toys.sphere, 5, (150.0, 1300.0)),
    "fruit": Kind(toys.fruit, 4, FOOD, lies=0.3),
    "stone": Kind(toys.stone, 3, (300.0, 2500.0)),
    "banana": Kind(toys.banana, 2, FOOD),
    "car": Kind(toys.car, 2, PLASTIC, lies=0.1, upside_down=0.1),
    "animal": Kind(toys.animal, 2, PLASTIC, lies=0.3),
    "figure": Kind(toys.figure, 2, WOOD, lies=0.4),
    "duck": Kind(toys.duck, 2, (150.0, 1000.0)),
    "studs": Kind(toys.studs, 2, PLASTIC, lies=0.15, upside_down=0.2),
    "stack": Kind(toys.stack, 2, WOOD, lies=0.2),
    "bridge": Kind(toys.bridge, 2, WOOD, lies=0.2, upside_down=0.2),
    "profile": Kind(toys.profile, 2, (200.0, 2700.0), lies=0.2, upside_down=0.3),
    "wedge": Kind(toys.wedge, 3, PACKED, lies=0.2),
    "gem": Kind(toys.gem, 3, PLASTIC, lies=0.25, upside_down=0.15),
    "mushroom": Kind(toys.mushroom, 2, WOOD, lies=0.3, upside_down=0.3),
    "device": Kind(toys.device, 3, (400.0, 1400.0), lies=0.1, upside_down=0.1),
}
NAMES = tuple(KINDS)
SHARES = np.array([kind.weight for kind in KINDS.values()]) / sum(kind.weight for kind in KINDS.values())


def draw_kind(rng: np.random.Generator) -> str:
    """The name of a kind; one number of the stream is used."""
    return NAMES[int(rng.choice(len(NAMES), p=SHARES))]
