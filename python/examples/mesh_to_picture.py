"""Builds a DAG of a mesh in numpy arrays, and writes a picture of its voxels, made with rays.

usage: mesh_to_picture.py [PICTURE.png]
"""

import sys
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import voxdag

# The mesh is a knotted tube: vertices (N, 3) and triangles (M, 3), which are made below.
around, across = 400, 24
t = np.linspace(0, 2 * np.pi, around, endpoint=False)
center = np.stack(
    [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1
)
along = np.roll(center, -1, axis=0) - np.roll(center, 1, axis=0)
along /= np.linalg.norm(along, axis=1, keepdims=True)
side = np.cross(along, [0, 0, 1.0])
side /= np.linalg.norm(side, axis=1, keepdims=True)
up = np.cross(side, along)
s = np.linspace(0, 2 * np.pi, across, endpoint=False)
vertices = center[:, None] + 0.45 * (
    np.cos(s)[:, None] * side[:, None] + np.sin(s)[:, None] * up[:, None]
)
a = np.arange(around)[:, None] * across + np.arange(across)
b, d = np.roll(a, -1, axis=0), np.roll(a, -1, axis=1)
c = np.roll(b, -1, axis=1)
triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "knot.vdag"
    report = voxdag.build((vertices.reshape(-1, 3), triangles), resolution=1024, output=path)
    with voxdag.open(path) as dag:
        # One ray per pixel, straight down.
        low, high = dag.bounds
        x, y = np.meshgrid(np.linspace(low[0], high[0], 480), np.linspace(high[1], low[1], 480))
        origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, high[2])], axis=1)
        hits = dag.rays(origins, [[0, 0, -1.0]], world=True)
        depth = np.where(hits.hit, hits.distance, np.nan).reshape(x.shape)

plt.imsave(
    sys.argv[1] if len(sys.argv) > 1 else "knot.png",
    np.nan_to_num(-depth, nan=-np.nanmax(depth)),
    cmap="magma",
)
print(f"{report['voxels']} voxels, {report['dag_nodes']} nodes, {int(hits.hit.sum())} rays hit")
