#!/usr/bin/env python3
"""Draws docs/images/folders.svg: which folder includes which, read from the include lines.

    tools/source/draw_folders.py            writes the picture
    tools/source/draw_folders.py --check    exits 1 if the picture is not up to date

If a folder a includes b, and b includes c, an arrow from a to c is left out, so that the picture
shows the layers. The folders tests, bench and docs are left out, because they include all folders.
The installed headers are left out, because all folders include them.
"""

import collections
import subprocess
import sys

from check_folders import INCLUDE, PRODUCT_INCLUDES, SOURCE, layer_of

PICTURE = "docs/images/folders.svg"
BOX_WIDTH, BOX_HEIGHT = 150, 46
STEP_X, STEP_Y, MARGIN = 175, 96, 16

# Position of a folder's box, in columns and rows from the upper left, and the folder's contents.
# Folders are above the folders they include.
BOXES = {
    "cli": (2.9, 0, "commands"),
    "python": (4.4, 1, "Python package"),
    "client": (0, 1, "HTTP client"),
    "server": (2.5, 1, "HTTP service"),
    "library": (3.6, 1, "voxdag/build.h"),
    "scheduler": (2.9, 2, "the build"),
    "edit": (4.4, 2, "voxdag edit"),
    "core/db": (0.9, 3, "SQLite"),
    "core/backend": (1.85, 3, "cpu, parallel, cuda"),
    "merge": (2.8, 3, "sub-DAGs to one DAG"),
    "query": (4.4, 3, "lookups, rays, exports"),
    "core/format": (2.9, 4, "artifacts, global file"),
    "scene": (4.2, 4, "glTF, PLY, generators"),
    "core/dag": (2.2, 5, "brick, node, hash"),
    "core/geometry": (2.6, 6, "grid, overlap test"),
    "core/color": (3.2, 5, "color rule, blocks"),
    "core/image": (4.4, 5, "PNG, JPEG"),
    "core/io": (3.9, 6, "file access"),
    "core/fields": (1.3, 6, "struct descriptions"),
    "core/base": (1.6, 7, "errors, budget, text"),
}


def include_graph():
    """Returns, for each folder, the other folders that its sources include."""
    listing = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True, text=True)
    graph = collections.defaultdict(set)
    for path in filter(SOURCE.search, listing.stdout.split("\0")):
        source = layer_of(path)
        if source not in PRODUCT_INCLUDES:
            continue
        graph[source]
        with open(path, encoding="utf-8") as file:
            for line in file:
                match = INCLUDE.match(line)
                if match and match.group(1) == '"' and "/" in match.group(2):
                    target = layer_of(match.group(2))
                    if target in PRODUCT_INCLUDES:
                        graph[source].add(target)
        graph[source].discard(source)
    return graph


def reachable(graph, start):
    seen, waiting = set(), [start]
    while waiting:
        for target in graph[waiting.pop()] - seen:
            seen.add(target)
            waiting.append(target)
    return seen


def reduced(graph):
    """Returns the graph without the arrows that follow from other arrows."""
    return {
        source: {
            target
            for target in targets
            if not any(target in reachable(graph, other) for other in targets - {target})
        }
        for source, targets in graph.items()
    }


def corner_of(folder):
    """Returns the upper left corner of the folder's box, in pixels."""
    column, row, _ = BOXES[folder]
    return MARGIN + column * STEP_X, MARGIN + row * STEP_Y


def draw(graph):
    arrows = reduced(graph)
    places = {folder: corner_of(folder) for folder in graph}
    width = max(x for x, _ in places.values()) + BOX_WIDTH + MARGIN
    height = max(y for _, y in places.values()) + BOX_HEIGHT + MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}"'
        ' font-family="sans-serif">',
        "<title>Which folder of voxdag includes which</title>",
        '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7"'
        ' markerHeight="7" orient="auto"><path d="M0 0L8 4L0 8z" fill="#5a6b7b"/></marker></defs>',
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
    ]
    for source in sorted(arrows):
        x, y = places[source]
        for target in sorted(arrows[source]):
            to_x, to_y = places[target]
            x1, y1 = x + BOX_WIDTH / 2, y + BOX_HEIGHT
            x2, y2 = to_x + BOX_WIDTH / 2, to_y - 2
            bend = (y2 - y1) * 0.45
            lines.append(
                f'<path d="M{x1:.0f} {y1:.0f}C{x1:.0f} {y1 + bend:.0f} {x2:.0f} {y2 - bend:.0f}'
                f' {x2:.0f} {y2:.0f}" fill="none" stroke="#5a6b7b" stroke-width="1.4"'
                ' marker-end="url(#head)"/>'
            )
    for folder in sorted(places):
        x, y = places[folder]
        fill = "#e8f0f8" if folder.startswith("core/") else "#f6efdf"
        lines.append(
            f'<rect x="{x:.0f}" y="{y:.0f}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="6"'
            f' fill="{fill}" stroke="#33475b"/>'
        )
        labels = ((folder, 19, 14, "bold"), (BOXES[folder][2], 36, 11.5, "normal"))
        for text, down, size, weight in labels:
            lines.append(
                f'<text x="{x + BOX_WIDTH / 2:.0f}" y="{y + down:.0f}" text-anchor="middle"'
                f' font-size="{size}" font-weight="{weight}" fill="#1c2733">{text}</text>'
            )
    return "\n".join(lines + ["</svg>"]) + "\n"


def main():
    picture = draw(include_graph())
    if "--check" in sys.argv[1:]:
        with open(PICTURE, encoding="utf-8") as file:
            if file.read() == picture:
                return 0
        print(f"{PICTURE}: is not of the current sources; run tools/source/draw_folders.py")
        return 1
    with open(PICTURE, "w", encoding="utf-8") as file:
        file.write(picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
