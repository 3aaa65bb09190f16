"""Shows a Dag in a notebook."""

from __future__ import annotations

import base64
import html
from typing import TYPE_CHECKING

from ._png import png_of
from ._render import render

if TYPE_CHECKING:
    from ._dag import Dag

_SIZE = (384, 216)


def picture_of(dag: Dag) -> bytes:
    """Returns a small picture as a PNG file."""
    return png_of(render(dag, size=_SIZE))


def html_of(dag: Dag) -> str:
    """Returns the properties of a file and a small picture."""
    picture = dag._repr_png_()
    if picture is None:
        return f"<code>{html.escape(repr(dag))}</code>"
    facts = {
        "file": dag.path,
        "resolution": f"{dag.resolution}³",
        "voxels": f"{dag.voxels:,}",
        "voxel size": f"{dag.voxel_size:.6g}",
        "attributes": ", ".join(dag.attributes) or "none",
    }
    rows = "".join(
        f"<tr><th style='text-align:left'>{name}</th>"
        f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
        for name, value in facts.items()
    )
    image = base64.b64encode(picture).decode()
    return (
        f"<div><img alt='picture of the voxels' width='{_SIZE[0]}' height='{_SIZE[1]}' "
        f"src='data:image/png;base64,{image}'><table>{rows}</table></div>"
    )
