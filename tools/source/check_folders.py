#!/usr/bin/env python3
"""Checks the structure of the tree (docs/architecture.md) over all tracked files.

Each folder may include only permitted folders, there is no cycle of includes between folders, each
third-party header is included only in permitted folders, and files and folders have at most their
maximum size. Prints one line per finding, as "file:line: problem". Exits 1 if there is a finding.
"""

import collections
import os
import re
import subprocess
import sys

# For each folder, the other folders that it may include. The relation is not transitive: every edge
# is listed.
CORE_INCLUDES = {
    "core/base": [],
    "core/fields": ["core/base"],
    "core/io": ["core/base"],
    "core/db": ["core/base", "core/io"],
    "core/geometry": ["core/base"],
    "core/dag": ["core/base", "core/geometry"],
    "core/backend": ["core/base", "core/geometry", "core/dag"],
    "core/format": ["core/base", "core/io", "core/geometry", "core/dag", "core/color"],
    "core/color": ["core/base", "core/geometry"],
    "core/image": ["core/base", "core/io"],
}
CORE = list(CORE_INCLUDES)
PRODUCT_INCLUDES = CORE_INCLUDES | {
    # core/format: SHA-256
    "scene": [
        "core/base",
        "core/fields",
        "core/io",
        "core/geometry",
        "core/color",
        "core/image",
        "core/format",
    ],
    "merge": CORE,
    "scheduler": CORE + ["scene", "merge", "query"],
    "library": CORE + ["scene", "scheduler"],
    "query": CORE + ["scene", "merge"],
    "client": ["core/base", "core/fields", "core/io", "core/format"],  # core/format: SHA-256
    "server": CORE + ["scene", "scheduler", "query", "client"],
    "edit": CORE + ["scene", "scheduler", "query"],
    "cli": CORE + ["scene", "scheduler", "query", "edit", "client", "server"],
    "python": CORE + ["scene", "scheduler", "query", "edit"],
}
# Tests mirror the folders and include the code under test; the product never includes tests.
ANYTHING = list(PRODUCT_INCLUDES)
INCLUDES = PRODUCT_INCLUDES | {
    "tests": ANYTHING,
    "bench": ANYTHING + ["tests"],
    "docs": ["core/format"],
    "include": [],
    "examples": [],
}
# Prefix of the installed headers. Every folder may include these headers. They include only each
# other and the standard library.
INSTALLED_PREFIX = "voxdag/"
# Other folders may include these folders only through these headers.
PUBLIC_HEADERS = {"merge": ["merge/merge.h", "merge/load/scratch_file.h"]}
# Tests and benchmarks may include more than the public header.
BEHIND_PUBLIC_HEADERS = ("tests", "bench")

# For some pairs of a folder and a folder that it includes: the only headers that it may include.
# Other folders may include more headers of that folder.
PUBLIC_HEADERS_TO = {
    ("scheduler", "query"): ["query/reorder/order_levels.h"],
    ("server", "client"): ["client/http_client.h"],
}

# Folders with layers of inner folders. An inner folder may include only itself and the inner
# folders that follow it in the list.
LAYERS = {
    "merge": [
        "merge",
        "merge/checkpoint",
        "merge/pass",
        "merge/fallback",
        "merge/sort",
        "merge/plan",
        "merge/output",
        "merge/load",
        "merge/types",
    ],
    "scheduler": [
        "scheduler",
        "scheduler/slurm",
        "scheduler/slurm/files",
        "scheduler/slurm/commands",
        "scheduler/cluster",
        "scheduler/stages/publish",
        "scheduler/stages/reorder",
        "scheduler/stages/attributes",
        "scheduler/stages/merge",
        "scheduler/stages/enclose",
        "scheduler/stages/build",
        "scheduler/stages/plan",
        "scheduler/stages/rows",
        "scheduler/stages/partition",
        "scheduler/stages/ingest",
        "scheduler/state/job",
        "scheduler/state/checkpoint",
        "scheduler/state",
        "scheduler/solid",
        "scheduler/triangles",
        "scheduler/spec",
    ],
    "scene": [
        "scene/formats",
        "scene/import",
        "scene/gltf",
        "scene/gltf/materials",
        "scene/gltf/mesh_data",
        "scene/gltf/compressed",
        "scene/gltf/document",
        "scene/gltf/json",
        "scene/gltf/uri",
        "scene/gltf/extensions",
        "scene/ply",
        "scene/ply/rows",
        "scene/points",
        "scene/obj",
        "scene/obj/materials",
        "scene/obj/file",
        "scene/stl",
        "scene/indexed",
        "scene/polygon",
        "scene/text",
        "scene/textures",
        "scene/vertices",
        "scene/generate",
        "scene",
    ],
    "server": [
        "server",
        "server/api/routes",
        "server/api/openapi",
        "server/api/routing",
        "server/api/context",
        "server/api/access",
        "server/api/answers",
        "server/site",
        "server/web",
        "server/tiles/partial",
        "server/tiles",
        "server/webhooks",
        "server/jobs",
        "server/jobs/process",
        "server/jobs/protocol",
        "server/scenes",
        "server/queue",
        "server/config",
        "server/http",
        "server/http/connection",
        "server/http/message",
        "server/disk",
        "server/base",
    ],
}
# Folders that only some files of their layer may include, given by the beginnings of their paths.
INCLUDED_BY = {
    "server/http": (
        "server/api/",
        "server/config/",
        "server/http/",
        "server/service.",
        "server/view_service.",
    )
}

# Third-party headers, and the folders where each may be included.
THIRD_PARTY = {
    "zstd.h": ["core/format"],
    "tiny_gltf.h": ["scene", "tests"],
    "draco/compression/mesh/mesh_edgebreaker_decoder.h": ["scene"],
    "meshoptimizer.h": ["scene", "tests"],
    "assimp/scene.h": ["scene"],
    "sqlite3.h": ["core/db"],
    "httplib.h": ["client"],
    "png.h": ["core/image"],
    "jpeglib.h": ["core/image", "tests"],
    "webp/decode.h": ["core/image"],
    "webp/encode.h": ["tests"],
    "avif/avif.h": ["core/image", "tests"],
    "zlib.h": ["query", "server", "tests", "bench"],
    "openvdb/openvdb.h": ["query", "bench", "tests"],
    "nanovdb/util/OpenToNanoVDB.h": ["query"],
}
# Folders that need nothing but a C++20 compiler (and CUDA).
BARE = ["core/base", "core/geometry", "core/dag", "core/color", "core/backend"]
LIBRARY = re.compile(
    r"(zstd|tiny_gltf|sqlite3|httplib|png|zlib|xxhash)\.h$|^(nlohmann|openssl|CLI|gtest|gmock|benchmark)/"
)
# The reader that users copy into their engine. Its three headers include only the standard library
# and each other.
STANDALONE_HEADERS = {
    "core/format/global/voxdag_reader.h": ["voxdag_reader_bytes.h", "voxdag_reader_colors.h"],
    "core/format/global/voxdag_reader_colors.h": ["voxdag_reader_bytes.h"],
    "core/format/global/voxdag_reader_bytes.h": [],
}
# The folders in which headers with a folder in their name are found.
INCLUDE_ROOTS = ("", "include/")
# The files that may test which compiler compiles them.
CUDA_PLACES = ("core/base/host_device.h", "core/backend/")
MAX_FILE_LINES = 500
MAX_FOLDER_FILES = 20

SOURCE = re.compile(r"\.(h|cc|cu|cuh)$")
COUNTED = re.compile(r"\.(h|cc|cu|cuh|py|sh|js)$|^(tools|\.ci)/")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
CUDA_MACRO = re.compile(r"\b__(CUDA|NVCC)\w*")


def layer_of(path):
    """Returns the folder of the tables above that a file belongs to."""
    if path.startswith(INSTALLED_PREFIX):
        return "include"
    parts = path.split("/")
    return "/".join(parts[:2]) if parts[0] == "core" else parts[0]


def folder_of(path):
    return path.rpartition("/")[0]


def check_inner_include(source, target, layers):
    """Returns the problem of an include between two folders of these layers, or None."""
    if layers is None:
        return None
    for folder in (source, target):
        if folder not in layers:
            return f"{folder} has no place among the layers of LAYERS"
    if layers.index(target) < layers.index(source):
        return f"{source} may not include {target}, which is a layer above it"
    return None


def check_include(path, bracket, header):
    """Returns the problem if the file at `path` includes `header`, or None."""
    layer = layer_of(path)
    if layer == "include" and ("." in header or "/" in header) and layer_of(header) != "include":
        return f"is installed, yet includes {header}"
    if bracket == "<":
        allowed = THIRD_PARTY.get(header)
        if allowed and layer not in allowed:
            return f"<{header}> is included in {' and '.join(allowed)} only"
        if layer in BARE and LIBRARY.search(header):
            return f"{layer} builds with a compiler alone, without <{header}>"
        return None
    if path in STANDALONE_HEADERS and header not in STANDALONE_HEADERS[path]:
        return f'stands alone, yet includes "{header}"'
    target = layer_of(header)
    if "/" not in header:
        return None
    if target == layer:
        for folder, includers in INCLUDED_BY.items():
            if header.startswith(folder + "/") and not path.startswith(includers):
                return f"{folder} is included by {', '.join(includers)} only"
        return check_inner_include(folder_of(path), folder_of(header), LAYERS.get(layer))
    if target != "include" and target not in INCLUDES[layer]:
        return f"{layer} may not include {target}"
    public = PUBLIC_HEADERS_TO.get((layer, target)) or PUBLIC_HEADERS.get(target)
    if public and header not in public and layer not in BEHIND_PUBLIC_HEADERS:
        return f"{target} is included through {' or '.join(public)} only"
    return None


def check_file(path, edges):
    with open(path, encoding="utf-8") as file:
        lines = file.read().splitlines()
    if COUNTED.search(path) and len(lines) > MAX_FILE_LINES:
        yield 1, f"{len(lines)} lines: expected at most {MAX_FILE_LINES} in a file"
    if not SOURCE.search(path):
        return
    if layer_of(path) not in INCLUDES:
        yield 1, "is in no folder of docs/architecture.md"
        return
    for number, line in enumerate(lines, start=1):
        if match := INCLUDE.match(line):
            if problem := check_include(path, *match.groups()):
                yield number, problem
            if match.group(1) == '"' and "/" in match.group(2):
                if not any(os.path.exists(root + match.group(2)) for root in INCLUDE_ROOTS):
                    yield number, f'there is no "{match.group(2)}"'
                edges.setdefault((folder_of(path), folder_of(match.group(2))), f"{path}:{number}")
        if not path.startswith(CUDA_PLACES) and (match := CUDA_MACRO.search(line)):
            yield number, f"{match.group()} belongs in {' or '.join(CUDA_PLACES)}"


def find_cycles(edges):
    """Yields (place, folders) for every set of folders that include each other."""
    graph = collections.defaultdict(set)
    for source, target in edges:
        if source != target:
            graph[source].add(target)

    def reachable(start):
        seen, waiting = set(), [start]
        while waiting:
            for target in graph[waiting.pop()]:
                if target not in seen:
                    seen.add(target)
                    waiting.append(target)
        return seen

    reach = {folder: reachable(folder) for folder in list(graph)}
    for source, target in sorted(edges):
        if source != target and source in reach.get(target, ()):
            yield (
                edges[source, target],
                f"{source} and {target} include each other (a folder cycle)",
            )


def check_folder_sizes(paths):
    counts = collections.Counter(folder_of(path) for path in paths)
    for folder, count in sorted(counts.items()):
        if count > MAX_FOLDER_FILES:
            yield f"{folder or '.'}: {count} files: expected at most {MAX_FOLDER_FILES} in a folder"


def main():
    listing = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True, text=True)
    paths = list(filter(None, listing.stdout.split("\0")))
    findings, edges = [], {}
    for path in paths:
        if SOURCE.search(path) or COUNTED.search(path):
            findings += [
                f"{path}:{number}: {problem}" for number, problem in check_file(path, edges)
            ]
    findings += [f"{place}: {problem}" for place, problem in find_cycles(edges)]
    findings += check_folder_sizes(paths)
    print("\n".join(findings), end="\n" if findings else "")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
