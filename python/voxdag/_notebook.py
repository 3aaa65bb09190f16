"""Shows a Dag in a notebook, and in the viewer of the program voxdag."""

from __future__ import annotations

import base64
import html
import json
import subprocess
import sys
import weakref
import webbrowser
from typing import TYPE_CHECKING

from ._error import Error
from ._png import png_of
from ._render import render

if TYPE_CHECKING:
    from typing_extensions import Self

    from ._dag import Dag

_SIZE = (384, 216)


def picture_of(dag: Dag) -> bytes:
    """Returns the bytes of a PNG file with a small picture of the voxels."""
    return png_of(render(dag, size=_SIZE))


def html_of(dag: Dag) -> str:
    """Returns HTML with a small picture of the voxels and a table of the file's properties."""
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


class Viewer:
    """A running viewer of a Dag. Dag.view() starts it.

    url   address of the viewer's page, which only programs on this machine can open

    A notebook shows a Viewer as a link with a picture. The viewer stops when close() is called,
    when its `with` block ends, when the Viewer is no longer referenced, or when this Python process
    ends."""

    url: str

    def __init__(self, dag: Dag, program: str) -> None:
        self._dag = dag
        try:
            process = subprocess.Popen(
                [program, "view", "--json", "--", dag.path],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        except FileNotFoundError:
            raise Error(
                f"there is no program {program!r}: expected the program voxdag in PATH, or its "
                "path in program=",
                "not_found",
            ) from None
        self._stop = weakref.finalize(self, _stop, process)
        assert process.stdout is not None and process.stderr is not None
        line = process.stdout.readline()
        if not line:
            message = process.stderr.read().decode(errors="replace").strip()
            self.close()
            raise Error(f"{program} view: {message or 'ended without an address'}", "io")
        self.url = json.loads(line)["url"]

    def close(self) -> None:
        """Stops the viewer."""
        self._stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<voxdag.Viewer {self.url}>"

    def _repr_html_(self) -> str:
        link = f"<a href='{self.url}' target='_blank'>Open the viewer: {self.url}</a>"
        return f"<div>{link}{html_of(self._dag)}</div>"


def view(dag: Dag, open_browser: bool | None, program: str) -> Viewer:
    viewer = Viewer(dag, program)
    if open_browser is None:
        open_browser = not _is_in_notebook()
    if open_browser:
        webbrowser.open(viewer.url)
    return viewer


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()


def _is_in_notebook() -> bool:
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return type(shell).__name__ == "ZMQInteractiveShell"
