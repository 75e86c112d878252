"""Things to work, write and eat with. Metres; each lies along x as it lies on a table."""

from __future__ import annotations

import numpy as np

from bayesgrasp.objects.procedural.pieces import (
    Corners,
    Draw,
    Pieces,
    X,
    Y,
    Z,
    arch,
    ball,
    block,
    hoop,
    moved,
    point,
    prism,
    ring,
    rod,
    rotated,
    rounded,
    square,
    turned,
    wall,
)


def _bar(start: float, end: float, radius: float, other: float | None = None, sides: int = 8) -> Corners:
    """A round bar along x at height 0."""
    return rod(start * X, end * X, radius, other, sides)


def hammer(draw: Draw) -> Pieces:
    """A handle and a head across it: a hammer, a mallet, an axe."""
    length, head, r = draw.size(0.12, 0.24), draw.size(0.05, 0.11), draw.size(0.007, 0.015)
    face = draw.size(0.018, 0.035)
    handle = _bar(0.0, length - face, r, r * draw.size(0.8, 1.2))
    if draw.chance(0.4):
        return [
            handle,
            rod(point(length - face, -head / 2, 0.0), point(length - face, head / 2, 0.0), face / 1.6),
        ]
    peen = moved([block(face, head * 0.55, face)], x=length - face, y=head * 0.22, z=-face / 2)
    tip = np.array([[i * face / 2, j, k] for i in (-1, 1) for j, k in ((0.0, -face / 2), (0.0, face / 2))])
    tail = np.array([[i * face / 2, -head / 2, draw.size(0.002, 0.006) * k] for i in (-1, 1) for k in (-1, 1)])
    return [handle, *peen, *moved([np.concatenate([tip, tail])], x=length - face)]


def screwdriver(draw: Draw) -> Pieces:
    """A thick grip and a thin shaft."""
    grip, shaft = draw.size(0.05, 0.11), draw.size(0.04, 0.12)
    r, thin = draw.size(0.01, 0.018), draw.size(0.003, 0.005)
    sides = 6 if draw.chance(0.5) else 8
    tip = moved([block(0.012, 3.2 * thin, 1.2 * thin)], x=grip + shaft, z=-0.6 * thin)
    return [
        _bar(0.0, 0.8 * grip, r, r, sides),
        _bar(0.8 * grip, grip, r, 0.6 * r, sides),
        _bar(grip, grip + shaft, thin),
        *tip,
    ]


def wrench(draw: Draw) -> Pieces:
    """A flat bar with a jaw at one end and a ring or a jaw at the other."""
    length, width, t = draw.size(0.09, 0.22), draw.size(0.014, 0.026), draw.size(0.008, 0.015)
    shank = moved([block(length, width, t)], x=length / 2)
    jaw = _jaw(width * draw.size(0.8, 1.2), t * draw.size(1.0, 1.4))
    pieces = shank + moved(jaw, x=length)
    if draw.chance(0.5):
        return pieces + rotated(jaw, Z, 180.0)
    r = width * draw.size(0.8, 1.1)
    return pieces + moved(wall((r, 0.0), (r, 1.2 * t), 0.4 * r, 8), x=-0.8 * r)


def _jaw(reach: float, t: float) -> Pieces:
    """Two prongs that open along x, and what joins them."""
    prong = np.array([[0.0, 0.35], [0.0, 1.0], [1.0, 0.95], [1.4, 0.75], [1.4, 0.5]]) * reach
    joint = np.array([[-0.5, -0.4], [-0.5, 0.4], [0.0, -1.0], [0.0, 1.0], [0.35, -0.5], [0.35, 0.5]]) * reach
    return [prism(joint, t), prism(prong, t), prism(prong * (1, -1), t)]


def pliers(draw: Draw) -> Pieces:
    """Two crossed levers: pliers, tongs, scissors."""
    length, t = draw.size(0.1, 0.19), draw.size(0.01, 0.017)
    spread, width = draw.size(8.0, 20.0), draw.size(0.008, 0.015)
    lever = moved([rounded(0.65 * length, width, t, 0.004)], x=-0.32 * length)
    jaw = prism(np.array([[0, -width], [0, width / 2], [0.35 * length, -0.1 * width], [0.35 * length, 0.3 * width]]), t)
    one = [*rotated(lever, Z, spread), *rotated([jaw], Z, spread / 4)]
    other = [piece * (1, -1, 1) for piece in one]
    return one + other + turned([(width, 0.0), (width, 1.2 * t)], 8)


def spoon(draw: Draw) -> Pieces:
    """A spoon, a spatula, a fork or a brush: a thin handle and a wide end."""
    length, t, width = draw.size(0.09, 0.19), draw.size(0.008, 0.014), draw.size(0.01, 0.018)
    wide, long = width * draw.size(2.0, 4.0), draw.size(0.03, 0.06)
    handle = moved([block(length, width, t)], x=-length / 2)
    if draw.chance(0.35):
        return [*handle, *moved([rounded(long, wide, 0.8 * t, wide)], x=long / 2 - 0.003)]
    if draw.chance(0.5):
        bristles = moved([block(long, wide, draw.size(0.012, 0.03))], x=long / 2)
        return handle + bristles
    dish = wall((0.25, 0.0), (0.5, 0.25), 0.12, 8) + turned([(0.27, 0.0), (0.27, 0.08)], 8)
    return handle + moved([piece * (long, wide, long) for piece in dish], x=long / 2 - 0.004)


def knife(draw: Draw) -> Pieces:
    """A grip and a blade."""
    grip, blade, t = draw.size(0.06, 0.11), draw.size(0.05, 0.13), draw.size(0.012, 0.022)
    width = draw.size(0.015, 0.03)
    edge = np.array([[0, -width / 2], [0, width / 2], [0.75 * blade, width / 2], [blade, 0.3 * width]])
    return [*moved([rounded(grip, 0.9 * width, t, 0.005)], x=-grip / 2), *moved([prism(edge, 0.25 * t)], z=0.3 * t)]


def pen(draw: Draw) -> Pieces:
    """A pen, a marker, a pencil, a candle, a lipstick: lying, with a tip."""
    length, r = draw.size(0.05, 0.17), draw.size(0.006, 0.014)
    sides = 6 if draw.chance(0.4) else 8
    tip = min(2.5 * r, 0.2 * length)
    return [_bar(0.0, length, r, r, sides), _bar(length, length + tip, r, 0.25 * r, sides)]


def stick(draw: Draw) -> Pieces:
    """A bar of any section: a dowel, a battery, a ruler, a bolt."""
    length = draw.size(0.04, 0.22)
    if draw.chance(0.4):
        return [block(length, draw.size(0.012, 0.035), draw.size(0.012, 0.028))]
    r = min(draw.size(0.008, 0.025), 0.4 * length)
    pieces = [_bar(0.0, length, r, r, 12)]
    return [*pieces, _bar(-0.8 * r, 0.0, 1.6 * r, 1.6 * r, 6)] if draw.chance(0.35) else pieces


def torch(draw: Draw) -> Pieces:
    """A grip that widens: a torch, a microphone, a light bulb, a club."""
    length, r = draw.size(0.07, 0.18), draw.size(0.009, 0.018)
    head, cone = r * draw.size(1.3, 2.2), draw.size(0.015, 0.03)
    if draw.chance(0.3):
        d = 2 * head
        return [_bar(0.0, length, r, r, 12), *moved([ball(d, d, d)], x=length + 0.6 * head, z=-head)]
    return [
        _bar(0.0, length, r, r, 12),
        _bar(length, length + cone, r, head, 12),
        _bar(length + cone, length + 2 * cone, head, head, 12),
    ]


def drill(draw: Draw) -> Pieces:
    """A power tool, a hair dryer, a glue gun: a barrel, a grip and a foot, lying on its side."""
    barrel, r = draw.size(0.1, 0.2), draw.size(0.017, 0.03)
    grip, width = draw.size(0.07, 0.12), draw.size(0.022, 0.034)
    pieces = [_bar(0.0, 0.7 * barrel, r, r, 12), _bar(0.7 * barrel, barrel, 0.7 * r, 0.3 * r, 12)]
    lean = rotated([block(1.3 * width, grip, width)], Z, draw.size(5.0, 18.0))
    pieces += moved(lean, x=0.2 * barrel, y=-0.45 * grip - 0.5 * r, z=-width / 2)
    if draw.chance(0.5):
        pieces += moved(
            [block(2.2 * width, 0.03, 1.6 * width)], x=0.28 * barrel, y=-0.9 * grip - 0.5 * r, z=-0.8 * width
        )
    return pieces


def clamp(draw: Draw) -> Pieces:
    """A frame open to one side: a clamp, a hook, a bracket, a horseshoe; it lies flat."""
    x, y, t = draw.size(0.04, 0.11), draw.size(0.05, 0.13), draw.size(0.012, 0.024)
    bar = draw.size(0.01, 0.022)
    if draw.chance(0.5):
        return rotated(hoop(arch(x / 2, y, 7), square(bar, t)), X, -90.0)
    arms = [moved([block(x, bar, t)], y=s * (y - bar) / 2)[0] for s in (-1, 1)]
    frame = [*arms, *moved([block(bar, y, t)], x=-x / 2)]
    if draw.chance(0.5):
        return frame
    return [*frame, rod(point(0.35 * x, 0.0, t / 2), point(0.35 * x, 0.75 * y, t / 2), 0.45 * t)]


def spool(draw: Draw) -> Pieces:
    """A waist between two flanges: a reel, an hourglass, a dumb-bell, a knob."""
    r, h = draw.size(0.015, 0.045), draw.size(0.03, 0.13)
    waist, flange = r * draw.size(0.35, 0.75), h * draw.size(0.1, 0.3)
    if draw.chance(0.5):
        return (
            turned([(r, 0.0), (r, flange)])
            + turned([(waist, flange), (waist, h - flange)])
            + turned([(r, h - flange), (r, h)])
        )
    return turned([(r, 0.0), (waist, h / 2), (r * draw.size(0.7, 1.0), h)])


def nut(draw: Draw) -> Pieces:
    """A ring with a thick wall: a nut, a washer, a roll of tape, a napkin ring."""
    r, h = draw.size(0.015, 0.06), draw.size(0.012, 0.05)
    sectors = 6 if draw.chance(0.3) else 12
    return wall((r, 0.0), (r * draw.size(0.85, 1.0), h), r * draw.size(0.15, 0.55), sectors)


def loop(draw: Draw) -> Pieces:
    """A ring with a round section: a bracelet, a quoit, a toy tyre."""
    r = draw.size(0.03, 0.075)
    angle = np.linspace(0, 2 * np.pi, 13)[:-1]
    path = r * np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=1)
    section = ring(r * draw.size(0.16, 0.35), 0.0, 6)
    return rotated(hoop(path, section, closed=True), X, 90.0)


def handle(draw: Draw) -> Pieces:
    """A drawer handle, a door knob on its plate, an iron: a base with something to hold."""
    x, y, z = draw.size(0.06, 0.18), draw.size(0.025, 0.08), draw.size(0.006, 0.03)
    base = rounded(x, y, z, 0.3 * y)
    bar = draw.size(0.009, 0.018)
    if draw.chance(0.6):
        return [base, *moved(hoop(arch(0.38 * x, draw.size(0.03, 0.06), 5), square(bar)), z=z)]
    r = draw.size(0.012, 0.025)
    return [base, *moved(turned([(0.5 * r, 0.0), (0.5 * r, r), (r, 1.6 * r), (0.8 * r, 2.4 * r)]), z=z)]


def cross(draw: Draw) -> Pieces:
    """Bars that cross: a tap, a jack, a star, a caltrop."""
    length, t = draw.size(0.035, 0.13), draw.size(0.012, 0.025)
    t = min(t, 0.4 * length)
    bars = [rotated([block(length, t, t)], Z, 180 * k / n)[0] for n in [draw.whole(2, 3)] for k in range(n)]
    if draw.chance(0.5):
        bars += moved([block(t, t, length)], z=0.5 * t - 0.5 * length)
    return bars


def pick(draw: Draw) -> Pieces:
    """An elbow: a hex key, a pipe fitting, a corner, a tee."""
    r, one, two = draw.size(0.007, 0.02), draw.size(0.04, 0.16), draw.size(0.03, 0.09)
    start = one * draw.size(0.3, 1.0) * X if draw.chance(0.4) else np.zeros(3)
    return [rod(-r * X, one * X, r), rod(start - r * Y, start + two * Y, r * draw.size(0.8, 1.2))]
