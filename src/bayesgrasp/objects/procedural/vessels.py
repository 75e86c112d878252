"""Things that hold something: boxes, cans, bottles, cups, bowls, plates, trays, pans. Metres; each stands upright."""

from __future__ import annotations

import numpy as np

from bayesgrasp.objects.procedural.pieces import (
    Draw,
    Pieces,
    Y,
    arch,
    block,
    hoop,
    moved,
    point,
    rod,
    rotated,
    rounded,
    square,
    turned,
    wall,
)


def carton(draw: Draw) -> Pieces:
    """A box whose smallest edge a hand can span."""
    edges = np.sort([draw.size(0.015, 0.11), draw.size(0.02, 0.16), draw.size(0.03, 0.22)])
    x, y, z = draw.rng.permutation(edges)
    return [rounded(x, y, z, draw.size(0.002, 0.02)) if draw.chance(0.3) else block(x, y, z)]


def cube(draw: Draw) -> Pieces:
    """A small block: a die, a toy brick."""
    edge = draw.size(0.02, 0.06)
    x, y, z = (edge * draw.size(0.7, 1.4) for _ in range(3))
    return [block(x, y, z)]


def flat_box(draw: Draw) -> Pieces:
    """A book, a telephone, a case, a bar of chocolate."""
    x, y, z = draw.size(0.04, 0.15), draw.size(0.08, 0.22), draw.size(0.01, 0.045)
    if draw.chance(0.4):
        return [block(x, y, z)]
    return [rounded(x, y, z, draw.size(0.004, 0.03))]


def can(draw: Draw) -> Pieces:
    """A tin, its rims drawn in or not."""
    r, h = draw.size(0.015, 0.055), draw.size(0.025, 0.16)
    if draw.chance(0.5):
        return turned([(r, 0.0), (r, h)])
    inset, slope = r * draw.size(0.75, 0.95), h * draw.size(0.04, 0.12)
    return turned([(inset, 0.0), (r, slope), (r, h - slope), (inset, h)])


def bottle(draw: Draw) -> Pieces:
    """Body, shoulder, neck and cap; round or flat."""
    r, h = draw.size(0.017, 0.045), draw.size(0.09, 0.25)
    neck, shoulder, top = r * draw.size(0.3, 0.6), h * draw.size(0.5, 0.75), h * draw.size(0.78, 0.9)
    cap = neck * draw.size(1.05, 1.4)
    waist = r * draw.size(0.75, 1.0)
    body = [(r, 0.0), (waist, shoulder / 2), (r, shoulder)] if draw.chance(0.3) else [(r, 0.0), (r, shoulder)]
    pieces = turned([*body, (neck, top), (neck, h * 0.93)]) + moved(turned([(cap, 0.0), (cap, 0.07 * h)]), z=0.93 * h)
    flat = (1.0, draw.size(0.5, 0.9), 1.0) if draw.chance(0.35) else (1.0, 1.0, 1.0)
    return [piece * flat for piece in pieces]


def spray(draw: Draw) -> Pieces:
    """A bottle with a trigger that stands out."""
    r, h = draw.size(0.025, 0.04), draw.size(0.14, 0.2)
    pieces = turned([(r, 0.0), (r, 0.6 * h), (0.4 * r, 0.75 * h), (0.4 * r, 0.85 * h)])
    head = moved([block(2.2 * r, 0.7 * r, 0.15 * h)], x=0.5 * r, z=0.85 * h)
    lever = rotated([block(0.25 * r, 0.5 * r, 0.22 * h)], Y, 15.0)
    return pieces + head + moved(lever, x=0.8 * r, z=0.66 * h)


def jar(draw: Draw) -> Pieces:
    """A wide body and a lid."""
    r, h = draw.size(0.02, 0.05), draw.size(0.04, 0.14)
    lid = r * draw.size(0.75, 1.1)
    return turned([(r, 0.0), (r, 0.75 * h), (0.72 * r, 0.82 * h)]) + moved(
        turned([(lid, 0.0), (lid, 0.2 * h)]), z=0.8 * h
    )


def tumbler(draw: Draw) -> Pieces:
    """A cup without a handle."""
    base = draw.size(0.018, 0.036)
    rim, h = base * draw.size(1.0, 1.4), draw.size(0.05, 0.15)
    floor, thickness = draw.size(0.004, 0.009), draw.size(0.0025, 0.006)
    return turned([(base, 0.0), (base, floor)]) + wall((base, 0.0), (rim, h), thickness)


def mug(draw: Draw) -> Pieces:
    """A cup with a handle."""
    base = draw.size(0.026, 0.042)
    rim, h, thickness = base * draw.size(0.95, 1.3), draw.size(0.05, 0.12), draw.size(0.003, 0.006)
    cup = turned([(base, 0.0), (base, 0.006)]) + wall((base, 0.0), (rim, h), thickness, sectors=10)
    reach, bar = draw.size(0.018, 0.032), draw.size(0.006, 0.011)
    bow = rotated(hoop(arch(0.32 * h, reach), square(bar, 1.2 * bar)), Y, 90.0)
    return cup + moved(bow, x=(base + rim) / 2 - 1.2 * thickness, z=h / 2)


def bowl(draw: Draw) -> Pieces:
    """A foot, a curved floor, and a wall."""
    rim, h = draw.size(0.035, 0.09), draw.size(0.025, 0.075)
    thickness, foot = draw.size(0.0025, 0.006), rim * draw.size(0.35, 0.6)
    bend, low = rim * draw.size(0.75, 0.95), h * draw.size(0.25, 0.4)
    floor = turned([(foot, 0.0), (foot * 1.3, 0.3 * low + 0.004)])
    return floor + wall((foot, 0.0), (bend, low), thickness, 7) + wall((bend, low), (rim, h), thickness, 7)


def plate(draw: Draw) -> Pieces:
    """A floor and a rim that rises a little."""
    rim, h = draw.size(0.05, 0.115), draw.size(0.014, 0.03)
    floor, thickness = rim * draw.size(0.55, 0.75), draw.size(0.003, 0.006)
    return turned([(floor, 0.0), (floor, thickness)]) + wall((floor, 0.0), (rim, h), thickness)


def goblet(draw: Draw) -> Pieces:
    """A foot, a stem and a cup: a wine glass, an egg cup, a trophy."""
    r, h = draw.size(0.02, 0.042), draw.size(0.06, 0.2)
    stem, low, thickness = draw.size(0.004, 0.008), h * draw.size(0.3, 0.5), draw.size(0.0025, 0.005)
    foot = turned([(r * 0.9, 0.0), (r * 0.9, 0.004), (stem, 0.012), (stem, low)])
    cup = turned([(stem, low), (0.6 * r, low + 0.1 * h), (r, low + 0.2 * h)])
    return foot + cup + wall((r, low + 0.2 * h), (r * draw.size(0.85, 1.1), h), thickness, 10)


def tray(draw: Draw) -> Pieces:
    """An open box: a drawer, a soap dish, a crate."""
    x, y, h, t = draw.size(0.05, 0.13), draw.size(0.07, 0.22), draw.size(0.02, 0.09), draw.size(0.003, 0.007)
    sides = [moved([block(x, t, h)], y=s * (y - t) / 2)[0] for s in (-1, 1)]
    ends = [moved([block(t, y, h)], x=s * (x - t) / 2)[0] for s in (-1, 1)]
    return [block(x, y, t), *sides, *ends]


def basket(draw: Draw) -> Pieces:
    """An open box or a bucket with an arch over it."""
    if draw.chance(0.5):
        r, h = draw.size(0.025, 0.055), draw.size(0.05, 0.11)
        body = turned([(0.8 * r, 0.0), (0.8 * r, 0.005)]) + wall((0.8 * r, 0.0), (r, h), 0.004, 9)
        span, width = r - 0.003, 0.01
    else:
        x, y, h = draw.size(0.05, 0.11), draw.size(0.05, 0.1), draw.size(0.03, 0.06)
        sides = [moved([block(x, 0.004, h)], y=s * y / 2)[0] for s in (-1, 1)]
        ends = [moved([block(0.004, y, h)], x=s * x / 2)[0] for s in (-1, 1)]
        body, span, width = [block(x, y, 0.005), *sides, *ends], x / 2, 0.015
    bar = square(draw.size(0.004, 0.008), width)
    return body + moved(hoop(arch(span, draw.size(0.5, 1.1) * span + 0.02, 5), bar), z=h - 0.004)


def pan(draw: Draw) -> Pieces:
    """A pan or a ladle: a round vessel with a straight handle."""
    r, h = draw.size(0.025, 0.075), draw.size(0.02, 0.07)
    reach = min(draw.size(0.07, 0.15), 0.25 - 2 * r)
    body = turned([(0.9 * r, 0.0), (0.9 * r, 0.005)]) + wall((0.9 * r, 0.0), (r, h), draw.size(0.003, 0.005), 10)
    start = point(0.95 * r, 0.0, 0.8 * h)
    return [*body, rod(start, start + point(reach, 0.0, draw.size(0.002, 0.03)), draw.size(0.005, 0.009))]


def watering_can(draw: Draw) -> Pieces:
    """A pot with a spout and a handle: a teapot, a jug, an oil can."""
    r, h = draw.size(0.025, 0.05), draw.size(0.05, 0.12)
    body = turned([(0.85 * r, 0.0), (r, 0.4 * h), (0.65 * r, 0.9 * h), (0.4 * r, h)])
    start = point(0.8 * r, 0.0, 0.3 * h)
    spout = rod(start, start + point(draw.size(0.03, 0.06), 0.0, 0.55 * h), 0.3 * r, 0.15 * r)
    bow = rotated(hoop(arch(0.3 * h, draw.size(0.02, 0.035)), square(draw.size(0.006, 0.011))), Y, -90.0)
    return [*body, spout, *moved(bow, x=-0.72 * r, z=0.5 * h)]
