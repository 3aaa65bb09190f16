"""Builds sparse voxel DAGs of huge triangle scenes, and queries them with numpy arrays.

    report = voxdag.build("scene.glb", resolution=8192, output="scene.vdag")
    with voxdag.open("scene.vdag") as dag:
        dag.lookup([[10, 20, 30]])              # is the voxel set?
        dag.rays(origins, directions)           # the first voxel on each ray
        dag.dense(region, level=8)              # a box of the grid with 2^8 cells per edge

Long calls release the interpreter's lock, so other Python threads can run. build(), plan(),
extract(), export() and render() stop on Ctrl-C. Errors of this package are `voxdag.Error`, with a
`code`.
"""

from ._build import Mesh, Progress, Scene, build, plan
from ._dag import Dag, Hits, Region, open
from ._derive import export, export_formats, extract
from ._error import Error
from ._render import render

__all__ = [
    "Dag",
    "Error",
    "Hits",
    "Mesh",
    "Progress",
    "Region",
    "Scene",
    "build",
    "export",
    "export_formats",
    "extract",
    "open",
    "plan",
    "render",
]
__version__ = "0.1.0"
