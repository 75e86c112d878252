"""Things to play with, to eat, and things that are only a shape. Metres; each stands upright."""

from __future__ import annotations

import numpy as np

from bayesgrasp.objects.procedural.pieces import (
    Draw,
    Pieces,
    X,
    Y,
    ball,
    block,
    moved,
    point,
    prism,
    rod,
    rotated,
    rounded,
    stretched,
    turned,
)


def sphere(draw: Draw) -> Pieces:
    """A ball: from a marble to a grapefruit."""
    d = draw.size(0.02, 0.12)
    return [ball(d, d, d)]


def fruit(draw: Draw) -> Pieces:
    """An ellipsoid, or two that join: an egg, a lemon, a pear, a soap."""
    d = draw.size(0.03, 0.095)
    body = ball(d, d * draw.size(0.75, 1.2), d * draw.size(0.6, 1.3))
    if draw.chance(0.6):
        return [body]
    top = d * draw.size(0.45, 0.8)
    return [body, *moved([ball(top, top, top)], x=draw.shift(0.15 * d), z=0.55 * float(np.ptp(body[:, 2])))]


def stone(draw: Draw) -> Pieces:
    """The hull of random points: a stone, a potato, a piece of bread."""
    corners = draw.rng.normal(size=(draw.whole(9, 24), 3))
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    d = draw.size(0.035, 0.1)
    return [0.5 * d * corners * (draw.size(0.7, 1.6), draw.size(0.7, 1.2), draw.size(0.5, 1.1))]


def banana(draw: Draw) -> Pieces:
    """A bent bar that tapers: a banana, a croissant, a sausage."""
    n, r = 6, draw.size(0.011, 0.022)
    bend, radius = np.radians(draw.size(30.0, 150.0)), draw.size(0.05, 0.12)
    angle = np.linspace(-bend / 2, bend / 2, n + 1)
    path = radius * np.stack([np.sin(angle), np.cos(angle), np.zeros(n + 1)], axis=1)
    thick = [r * share for share in (0.45, 0.8, 1.0, 1.0, 1.0, 0.8, 0.45)]
    return [rod(path[i], path[i + 1], thick[i], thick[i + 1], 10) for i in range(n)]


def car(draw: Draw) -> Pieces:
    """A toy car or lorry: a body, a cabin and four wheels."""
    x, y, z = draw.size(0.05, 0.15), draw.size(0.025, 0.06), draw.size(0.012, 0.03)
    r = draw.size(0.25, 0.4) * y
    roof = np.array([[-0.5, 0], [0.5, 0], [-0.3, 1], [0.25, 1]]) * (x * draw.size(0.4, 0.7), z * draw.size(0.8, 1.5))
    cabin = rotated([prism(roof, 0.85 * y)], X, 90.0)
    pieces = [
        *moved([rounded(x, y, z, 0.2 * y)], z=0.6 * r),
        *moved(cabin, x=draw.shift(0.15 * x), y=0.425 * y, z=0.6 * r + z),
    ]
    for i in (-0.32, 0.32):
        for side in (-0.5, 0.5):
            hub = point(i * x, side * y, r)
            pieces.append(rod(hub - 0.1 * y * Y, hub + 0.1 * y * Y, r, sides=10))
    return pieces


def animal(draw: Draw) -> Pieces:
    """A toy animal: a body, a head, legs and a tail."""
    x, leg = draw.size(0.05, 0.12), draw.size(0.015, 0.05)
    y, z, r = x * draw.size(0.3, 0.6), x * draw.size(0.3, 0.55), x * draw.size(0.06, 0.1)
    pieces = moved([ball(x, y, z)], z=0.8 * leg)
    for i in (-0.28, 0.28):
        for side in (-0.25, 0.25):
            foot = point(i * x, side * y, 0.0)
            pieces.append(rod(foot, foot + point(0.0, 0.0, leg + 0.3 * z), r))
    head = x * draw.size(0.3, 0.45)
    pieces += moved([ball(1.2 * head, head, head)], x=0.5 * x, z=0.8 * leg + 0.6 * z + draw.size(0.001, 0.04))
    tail = point(-0.45 * x, 0.0, 0.8 * leg + 0.5 * z)
    return [*pieces, rod(tail, tail + point(-0.3 * x, 0.0, 0.1 * x), 0.6 * r)]


def figure(draw: Draw) -> Pieces:
    """A toy person or a chess piece: a base, a body and a head."""
    r, h = draw.size(0.012, 0.032), draw.size(0.04, 0.12)
    head = r * draw.size(0.9, 1.5)
    body = turned([(r, 0.0), (r, 0.12 * h), (0.75 * r, 0.16 * h), (0.45 * r, 0.75 * h)])
    pieces = body + moved([ball(head, head, 1.1 * head)], z=0.72 * h)
    if draw.chance(0.4):
        pieces.append(rod(point(0.0, -1.6 * r, 0.5 * h), point(0.0, 1.6 * r, 0.5 * h), 0.25 * r))
    return pieces


def duck(draw: Draw) -> Pieces:
    """A bath duck: a body, a head and a beak."""
    x = draw.size(0.04, 0.1)
    head = 0.5 * x * draw.size(0.8, 1.2)
    at = (0.25 * x, 0.0, 0.4 * x)
    beak = rod(point(0.4 * head, 0.0, 0.5 * head), point(0.75 * head, 0.0, 0.42 * head), 0.18 * head, 0.08 * head)
    pieces = [ball(x, 0.75 * x, 0.6 * x), *moved([ball(head, head, head), beak], *at)]
    tail = rod(point(-0.4 * x, 0.0, 0.4 * x), point(-0.55 * x, 0.0, 0.58 * x), 0.14 * x, 0.04 * x)
    return [*pieces, tail]


def studs(draw: Draw) -> Pieces:
    """A toy brick with studs, a muffin tin upside down, a plug."""
    nx, ny = draw.whole(1, 4), draw.whole(1, 2)
    pitch, z = draw.size(0.018, 0.034), draw.size(0.014, 0.04)
    pieces = [block(nx * pitch, ny * pitch, z)]
    for i in range(nx):
        for j in range(ny):
            stud = turned([(0.3 * pitch, 0.0), (0.3 * pitch, 0.22 * pitch)], 8)
            pieces += moved(stud, (i - (nx - 1) / 2) * pitch, (j - (ny - 1) / 2) * pitch, z)
    return pieces


def stack(draw: Draw) -> Pieces:
    """Blocks and discs on one another, glued: a tower, a cake, a tool on its case."""
    pieces, height = [], 0.0
    width, round_ = draw.size(0.035, 0.11), draw.chance(0.4)
    for _ in range(draw.whole(2, 4)):
        z = draw.size(0.01, 0.05)
        layer = turned([(width / 2, 0.0), (width / 2, z)]) if round_ else [block(width, width * draw.size(0.6, 1.3), z)]
        pieces += moved(layer, draw.shift(0.12 * width), draw.shift(0.12 * width), height)
        height, width = height + z, width * draw.size(0.6, 1.05)
        round_ = round_ != draw.chance(0.3)
    return pieces


def bridge(draw: Draw) -> Pieces:
    """Two legs and what spans them: a stool, a toy bridge, a door stop, a stapler."""
    x, y, h = draw.size(0.05, 0.15), draw.size(0.02, 0.07), draw.size(0.025, 0.09)
    t, leg = draw.size(0.008, 0.02), x * draw.size(0.12, 0.3)
    legs = [moved([block(leg, y, h)], x=s * (x - leg) / 2)[0] for s in (-1, 1)]
    return [*legs, *moved([block(x, y, t)], z=h - 0.3 * t)]


def profile(draw: Draw) -> Pieces:
    """A piece of an angle, a tee, a channel or a cross beam."""
    length, w, h, t = draw.size(0.04, 0.18), draw.size(0.025, 0.08), draw.size(0.025, 0.08), draw.size(0.004, 0.015)
    web = {0: (-0.5,), 1: (0.0,), 2: (-0.5, 0.5), 3: (-0.5, 0.0, 0.5)}[draw.whole(0, 3)]
    return [block(length, w, t), *(moved([block(length, t, h)], y=place * (w - t))[0] for place in web)]


def wedge(draw: Draw) -> Pieces:
    """A ramp, a piece of cheese or cake, a roof, a tent."""
    x, y, z = draw.size(0.03, 0.16), draw.size(0.02, 0.1), draw.size(0.02, 0.09)
    peak, blunt = draw.rng.uniform(-0.5, 0.5), draw.size(0.02, 0.3)
    outline = np.array([[-0.5, 0], [0.5, 0], [peak, 1], [peak * (1 - blunt), 1]]) * (x, z)
    return moved(rotated([prism(outline, y)], X, 90.0), y=y / 2)


def gem(draw: Draw) -> Pieces:
    """A prism or a pyramid with three to eight sides: a pot, a weight, a cone, a paper lantern."""
    sides, h = draw.whole(3, 8), draw.size(0.02, 0.16)
    r = draw.size(0.015, 0.055)
    top = r * draw.size(0.25, 1.0)
    return stretched(turned([(r, 0.0), (top, h)], sides), (1.0, draw.size(0.7, 1.2), 1.0))


def mushroom(draw: Draw) -> Pieces:
    """A cap on a stem: a mushroom, a stamp, a door knob, a plunger."""
    r, h, stem = draw.size(0.018, 0.045), draw.size(0.03, 0.1), draw.size(0.3, 0.6)
    cap = h * draw.size(0.25, 0.5)
    return turned([(r * stem, 0.0), (r * stem * 0.8, h - cap)]) + turned(
        [(r, h - cap), (0.9 * r, h - cap / 2), (0.45 * r, h)]
    )


def device(draw: Draw) -> Pieces:
    """A mouse, a remote control, a camera, a radio: a rounded case with something on it."""
    x, y, z = draw.size(0.05, 0.16), draw.size(0.035, 0.075), draw.size(0.016, 0.045)
    case = [rounded(x, y, z, 0.25 * y)]
    if draw.chance(0.4):
        lens = turned([(0.33 * y, 0.0), (0.3 * y, draw.size(0.01, 0.03))])
        return case + moved(lens, x=draw.shift(0.2 * x), z=z)
    if draw.chance(0.5):
        return case + moved([rounded(0.8 * x, 0.75 * y, 0.4 * z, 0.3 * y)], z=z)
    return case + moved([block(0.25 * x, 0.5 * y, 0.3 * z)], x=0.3 * x, z=z)
