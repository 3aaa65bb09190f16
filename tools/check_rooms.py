#!/usr/bin/env python3
"""Checks the walls between the rooms (docs/architecture.md) over all tracked sources.

Prints one line per finding, as "file:line: what is wrong"; exits 1 if there is any.
"""

import re
import subprocess
import sys

# Which rooms a room may include, itself aside; what those may include comes along.
CORE_DOORS = {
    "core/base": [],
    "core/io": ["core/base"],
    "core/geometry": ["core/base"],
    "core/dag": ["core/base", "core/geometry"],
    "core/backend": ["core/base", "core/geometry", "core/dag"],
    "core/format": ["core/base", "core/io", "core/dag"],
    "core/scene": ["core/base", "core/io", "core/geometry"],
}
CORE = list(CORE_DOORS)
DOORS = CORE_DOORS | {"merge": CORE, "scheduler": CORE + ["merge"]}
# Rooms that anyone may enter through one header only.
PUBLIC_HEADERS = {"merge": "merge/merge.h"}
# These may enter every room.
OPEN_ROOMS = ["cli", "server", "tests", "bench", "docs"]

# Third-party headers, and the one room where each may be included.
THIRD_PARTY_ROOMS = {
    "zstd.h": "core/format",
    "tiny_gltf.h": "core/scene",
    "sqlite3.h": "scheduler",
    "httplib.h": "server",
    "png.h": "cli",
}
# Rooms that build with a C++20 compiler (and CUDA) alone, and what they therefore never include.
BARE_ROOMS = ["core/base", "core/geometry", "core/dag", "core/backend"]
LIBRARY = re.compile(
    r"(zstd|tiny_gltf|sqlite3|httplib|png|xxhash)\.h$|^(nlohmann|openssl|CLI|gtest|gmock|benchmark)/"
)
# The reader that users copy into their engine: the standard library is all it may need.
STANDALONE_HEADER = "core/format/voxdag_reader.h"
# Where code may ask which compiler is at work.
CUDA_PLACES = ("core/base/host_device.h", "core/backend/")
LINE_LIMIT = 500

SOURCE = re.compile(r"\.(h|cc|cu|cuh)$")
COUNTED = re.compile(r"\.(h|cc|cu|cuh|py|sh|js)$|^(tools|\.ci)/")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
CUDA_MACRO = re.compile(r"\b__(CUDA|NVCC)\w*")


def room_of(path):
    parts = path.split("/")
    return "/".join(parts[:2]) if parts[0] == "core" else parts[0]


def reachable(room):
    rooms, waiting = {room}, [room]
    while waiting:
        for door in DOORS[waiting.pop()]:
            if door not in rooms:
                rooms.add(door)
                waiting.append(door)
    return rooms


def check_include(path, bracket, header):
    """What is wrong with this file including that header, or None."""
    room = room_of(path)
    if bracket == "<":
        if header in THIRD_PARTY_ROOMS and room != THIRD_PARTY_ROOMS[header]:
            return f"<{header}> is included in {THIRD_PARTY_ROOMS[header]} only"
        if room in BARE_ROOMS and LIBRARY.search(header):
            return f"{room} builds with a compiler alone, without <{header}>"
        return None
    if path == STANDALONE_HEADER:
        return f'stands alone, yet includes "{header}"'
    target = room_of(header)
    if target == room or room in OPEN_ROOMS:
        return None
    if target not in reachable(room):
        return f"{room} may not enter {target}"
    if target in PUBLIC_HEADERS and header != PUBLIC_HEADERS[target]:
        return f"{target} is entered through {PUBLIC_HEADERS[target]} only"
    return None


def check_file(path):
    with open(path, encoding="utf-8") as file:
        lines = file.read().splitlines()
    if COUNTED.search(path) and len(lines) > LINE_LIMIT:
        yield 1, f"{len(lines)} lines; what wants to leave a file of over {LINE_LIMIT}?"
    if not SOURCE.search(path):
        return
    if room_of(path) not in DOORS and room_of(path) not in OPEN_ROOMS:
        yield 1, "lies in no room of docs/architecture.md"
        return
    for number, line in enumerate(lines, start=1):
        if match := INCLUDE.match(line):
            if problem := check_include(path, *match.groups()):
                yield number, problem
        if not path.startswith(CUDA_PLACES) and (match := CUDA_MACRO.search(line)):
            yield number, f"{match.group()} belongs in {' or '.join(CUDA_PLACES)}"


def main():
    listing = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True, text=True)
    findings = 0
    for path in filter(None, listing.stdout.split("\0")):
        if not (SOURCE.search(path) or COUNTED.search(path)):
            continue
        for number, problem in check_file(path):
            print(f"{path}:{number}: {problem}")
            findings += 1
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
