"""Household objects made of parametric solids: always there, watertight, with masses of their everyday likes.

Five of them stand in for the paper's five ShapeNet objects, which cannot be redistributed; they belong to the training
split. The sizes fit a gripper that opens to 155 mm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bayesgrasp.objects.shapes import Solid, box, ellipsoid, handle, hollow, prism, turned, wedge


@dataclass(frozen=True)
class HouseholdObject:
    """A recipe.

    Attributes:
        mass_kg: Mass at scale 1.
        build: Makes the solid.
        stand_in: Whether it stands in for a ShapeNet object of the paper.
    """

    mass_kg: float
    build: Callable[[], Solid]
    stand_in: bool = False


def _mug() -> Solid:
    cup = hollow([(0.038, 0.0), (0.040, 0.095)], wall=0.004, floor=0.006)
    return cup + handle(distance=0.038, bottom=0.018, top=0.078, reach=0.030, thickness=0.009)


def _hammer() -> Solid:
    return box(0.25, 0.028, 0.022) + box(0.034, 0.100, 0.034).moved(x=0.120)


def _bottle() -> Solid:
    return turned([(0.036, 0.0), (0.036, 0.125), (0.014, 0.170), (0.014, 0.215)])


def _wine_glass() -> Solid:
    foot = turned([(0.035, 0.0), (0.035, 0.004), (0.006, 0.010), (0.006, 0.080)])
    bowl = hollow([(0.012, 0.0), (0.036, 0.028), (0.034, 0.080)], wall=0.003, floor=0.006)
    return foot + bowl.moved(z=0.078)


OBJECTS: dict[str, HouseholdObject] = {
    "household_bottle": HouseholdObject(0.45, _bottle, stand_in=True),
    "household_jar": HouseholdObject(
        0.38, lambda: turned([(0.040, 0.0), (0.040, 0.085), (0.033, 0.092), (0.033, 0.110)]), stand_in=True
    ),
    "household_tumbler": HouseholdObject(
        0.22, lambda: hollow([(0.030, 0.0), (0.040, 0.120)], wall=0.004, floor=0.008), stand_in=True
    ),
    "household_carton": HouseholdObject(0.52, lambda: box(0.070, 0.070, 0.190), stand_in=True),
    "household_coffee_mug": HouseholdObject(0.30, _mug, stand_in=True),
    "household_tea_box": HouseholdObject(0.09, lambda: box(0.065, 0.125, 0.070)),
    "household_book": HouseholdObject(0.35, lambda: box(0.130, 0.190, 0.035)),
    "household_drink_can": HouseholdObject(
        0.35, lambda: turned([(0.026, 0.0), (0.033, 0.008), (0.033, 0.107), (0.027, 0.122)])
    ),
    "household_candle": HouseholdObject(0.25, lambda: turned([(0.030, 0.0), (0.030, 0.100)])),
    "household_bowl": HouseholdObject(
        0.28, lambda: hollow([(0.030, 0.0), (0.058, 0.025), (0.070, 0.060)], wall=0.005, floor=0.006)
    ),
    "household_cup": HouseholdObject(0.12, lambda: hollow([(0.032, 0.0), (0.043, 0.075)], wall=0.004, floor=0.005)),
    "household_vase": HouseholdObject(
        0.40, lambda: turned([(0.030, 0.0), (0.045, 0.060), (0.018, 0.140), (0.028, 0.170)])
    ),
    "household_wine_glass": HouseholdObject(0.16, _wine_glass),
    "household_ball": HouseholdObject(0.10, lambda: ellipsoid(0.080, 0.080, 0.080)),
    "household_egg": HouseholdObject(0.06, lambda: ellipsoid(0.060, 0.044, 0.044)),
    "household_soap": HouseholdObject(0.10, lambda: ellipsoid(0.095, 0.062, 0.038)),
    "household_pencil_box": HouseholdObject(0.12, lambda: prism(0.040, 0.105, 6)),
    "household_cheese": HouseholdObject(0.20, lambda: wedge(0.120, 0.060, 0.060)),
    "household_spool": HouseholdObject(
        0.15,
        lambda: turned([(0.035, 0.0), (0.035, 0.012), (0.020, 0.013), (0.020, 0.062), (0.035, 0.063), (0.035, 0.075)]),
    ),
    "household_hammer": HouseholdObject(0.55, _hammer),
}
STAND_INS = tuple(name for name, made in OBJECTS.items() if made.stand_in)


def split_of(object_id: str) -> str:
    """Split of a household object: "train" for the five stand-ins, "household" for the rest."""
    return "train" if OBJECTS[object_id].stand_in else "household"
