"""Builds sparse voxel DAGs of huge triangle scenes, and queries them with numpy arrays.

    report = voxdag.build("scene.glb", resolution=8192, output="scene.vdag")
    with voxdag.open("scene.vdag") as dag:
        dag.lookup([[10, 20, 30]])              # True for each voxel that is set
        dag.rays(origins, directions)           # the first set voxel on each ray
        dag.dense(region, level=8)              # a region of the grid with 2^8 cells per edge

Long calls release the interpreter's lock, so other Python threads can run. build(), plan(),
combine(), edit(), extract(), reorder(), export() and render() stop on Ctrl-C. If a function fails,
it raises `voxdag.Error`, whose attribute `code` names the kind of the error.
"""

from ._build import Scene, build, plan
from ._dag import Dag, open
from ._derive import combine, edit, export, export_formats, extract, reorder
from ._error import Error
from ._mesh import Mesh
from ._notebook import Viewer
from ._progress import Progress
from ._render import render
from ._reports import BuildReport
from ._types import (
    Components,
    Estimate,
    ExportReport,
    ExtractReport,
    Hits,
    NodeOrder,
    Region,
    ReorderReport,
)
from ._voxels import from_dense, from_points, from_voxels

__all__ = [
    "BuildReport",
    "Components",
    "Dag",
    "Error",
    "Estimate",
    "ExportReport",
    "ExtractReport",
    "Hits",
    "Mesh",
    "NodeOrder",
    "Progress",
    "Region",
    "ReorderReport",
    "Scene",
    "Viewer",
    "build",
    "combine",
    "edit",
    "export",
    "export_formats",
    "extract",
    "from_dense",
    "from_points",
    "from_voxels",
    "open",
    "plan",
    "render",
    "reorder",
]
__version__ = "0.1.0"
