#!/usr/bin/env python3
"""Draws the pictures of docs/solid.md: solids of generated scenes, cut open.

    docs/images/draw_solids.py VOXDAG [FOLDER]

Writes solid-vase.png, solid-robot.png and solid-house.png to FOLDER, by default docs/images. Needs
the voxdag program; the scenes are made here.
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

IMAGES = Path(__file__).resolve().parent
RESOLUTION = 512


class Scene:
    """An OBJ scene of closed parts whose faces point outward, and of open sheets."""

    def __init__(self):
        self.vertices, self.faces = [], []

    def quads(self, rows):
        """Adds the faces between rows of points."""
        first, width = len(self.vertices) + 1, len(rows[0])
        for row in rows:
            self.vertices += row
        for i in range(len(rows) - 1):
            for j in range(width - 1):
                a = first + i * width + j
                self.faces.append((a, a + 1, a + width + 1, a + width))

    def turned(self, profile, center=(0, 0, 0), axis=1, steps=96):
        """Adds a profile of (radius, height) turned around an axis, from its low end."""
        rows = []
        for radius, height in profile:
            row = []
            for k in range(steps + 1):
                angle = 2 * math.pi * (k % steps) / steps
                at = [0, 0, 0]
                at[axis] = height
                at[(axis + 1) % 3] = radius * math.cos(angle)
                at[(axis + 2) % 3] = radius * math.sin(angle)
                row.append(tuple(c + a for c, a in zip(center, at)))
            rows.append(row)
        self.quads(rows)

    def ball(self, center, radius, steps=24):
        angles = [math.pi * (i / steps - 0.5) for i in range(steps + 1)]
        self.turned([(radius * math.cos(a), radius * math.sin(a)) for a in angles], center)

    def rod(self, center, radius, length, axis):
        ends = [(0, -length / 2), (radius, -length / 2), (radius, length / 2), (0, length / 2)]
        self.turned(ends, center, axis)

    def box(self, low, high):
        for axis in range(3):
            b, c = (axis + 1) % 3, (axis + 2) % 3
            for side in (low, high):
                corners = []
                for u, v in ((0, 0), (1, 0), (0, 1), (1, 1)):
                    at = [0, 0, 0]
                    at[axis], at[b], at[c] = side[axis], (low, high)[u][b], (low, high)[v][c]
                    corners.append(tuple(at))
                rows = [corners[:2], corners[2:]]
                self.quads(rows if side is high else rows[::-1])

    def write(self, path):
        lines = [f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in self.vertices]
        lines += [f"f {a} {b} {c} {d}\n" for a, b, c, d in self.faces]
        path.write_text("".join(lines), encoding="ascii")


def vase():
    """A vase with a thick wall and an open top: one closed surface."""
    outside = [(0, 0), (0.5, 0), (0.55, 0.06), (0.8, 0.55), (0.85, 0.9), (0.7, 1.3), (0.42, 1.62)]
    outside += [(0.4, 1.8), (0.55, 2)]
    inside = [(0.45, 1.98), (0.3, 1.8), (0.32, 1.6), (0.58, 1.25), (0.7, 0.9), (0.65, 0.58)]
    inside += [(0.4, 0.2), (0, 0.16)]
    scene = Scene()
    scene.turned(outside + inside)
    return scene


def robot():
    """Boxes, rods and balls that overlap at every joint."""
    scene = Scene()
    scene.box((-0.5, 1, -0.3), (0.5, 2.2, 0.3))
    scene.box((-0.35, 0.85, -0.25), (0.35, 1.1, 0.25))
    scene.rod((0, 2.3, 0), 0.12, 0.5, 1)
    scene.box((-0.35, 2.4, -0.3), (0.35, 2.95, 0.3))
    for x in (-0.18, 0.18):
        scene.rod((x, 2.72, 0.3), 0.09, 0.2, 2)
        scene.rod((1.1 * x, 3.1, 0), 0.03, 0.4, 1)
    for side in (-1, 1):
        scene.ball((0.55 * side, 2.0, 0), 0.2)
        scene.rod((0.72 * side, 1.65, 0), 0.12, 0.8, 1)
        scene.ball((0.72 * side, 1.25, 0), 0.17)
        scene.rod((0.72 * side, 1.2, 0.3), 0.11, 0.7, 2)
        scene.ball((0.25 * side, 0.85, 0), 0.2)
        scene.rod((0.25 * side, 0.5, 0), 0.14, 0.8, 1)
        scene.box((0.25 * side - 0.2, 0, -0.2), (0.25 * side + 0.2, 0.2, 0.4))
    return scene


def house():
    """A house of single faces. One room is closed, and the other room has an open door."""
    scene = Scene()

    def wall(x0, z0, x1, z1, low=0, high=1):
        scene.quads([[(x0, low, z0), (x1, low, z1)], [(x0, high, z0), (x1, high, z1)]])

    for y in (0, 1):
        scene.quads([[(-1.2, y, -1), (1.2, y, -1)], [(-1.2, y, 1), (1.2, y, 1)]])
    wall(-1.2, -1, 1.2, -1)
    wall(-1.2, -1, -1.2, 1)
    wall(1.2, -1, 1.2, 1)
    wall(0.1, -1, 0.1, 1)
    wall(0.1, 1, 1.2, 1)
    wall(-1.2, 1, -0.8, 1)
    wall(-0.4, 1, 0.1, 1)
    wall(-0.8, 1, -0.4, 1, 0.75)
    scene.box((-0.9, 0, -0.7), (-0.2, 0.35, -0.3))
    scene.ball((-0.55, 0.45, -0.5), 0.12)
    scene.rod((-0.9, 0.3, 0.3), 0.12, 0.6, 1)
    return scene


# Name, scene, rule, the cell at which the grid is cut and its axis, camera and target.
PICTURES = [
    ("vase", vase, "winding", (2, 250), "1.3,2.3,3.4", "0,0.97,-0.2"),
    ("robot", robot, "winding", (2, 256), "2.3,3.0,5.3", "0,1.68,-0.1"),
    ("house", house, "enclosed", (1, 290), "1.2,3.2,2.9", "0,0.1,0"),
]


def draw(voxdag, folder, name, scene, rule, cut, camera, target):
    def run(*args):
        subprocess.run([voxdag, *map(str, args), "-q"], check=True, stdout=subprocess.DEVNULL)

    with tempfile.TemporaryDirectory() as work:
        obj, solid, half = (Path(work) / file for file in ("s.obj", "solid.vdag", "half.vdag"))
        scene().write(obj)
        run("build", obj, "-r", RESOLUTION, "--solid", rule, "-o", solid)
        axis, cell = cut
        high = [RESOLUTION] * 3
        high[axis] = cell
        region = ",".join(map(str, [0, 0, 0, *high]))
        run("extract", solid, "--region", region, "-o", half)
        picture = Path(folder) / f"solid-{name}.png"
        view = ("--camera", camera, "--target", target, "--fov", 35, "--size", "400x300")
        run("render", half, "-o", picture, *view, "--samples", 4, "--force")
        print(f"{picture}: {picture.stat().st_size} bytes")


def main():
    folder = sys.argv[2] if len(sys.argv) > 2 else IMAGES
    for picture in PICTURES:
        draw(sys.argv[1], folder, *picture)


if __name__ == "__main__":
    main()
