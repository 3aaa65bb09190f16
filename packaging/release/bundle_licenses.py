"""Adds the licenses of its libraries to the unpacked wheel in FOLDER:

    packaging/release/bundle_licenses.py BUILD FOLDER

BUILD is the folder in which its module was built. Libraries that the wheel does not contain are
skipped.
"""

import shutil
import sys
from pathlib import Path

import libraries


def main(build, folder):
    (module,) = Path(build, "python", "voxdag").glob("_native*.so")
    (information,) = Path(folder).glob("voxdag-*.dist-info")
    bundled = {path.name for path in Path(folder, "voxdag.libs").iterdir()}
    target = information / "licenses" / "libraries"
    target.mkdir(parents=True)
    for library in libraries.libraries(module, build):
        # auditwheel inserts a hash into the names of files: libz-1a2b3c4d.so.1.2.13
        stems = {Path(file).name.split(".so")[0] + "-" for file in library["files"]}
        if stems and not any(name.startswith(tuple(stems)) for name in bundled):
            continue
        if not library["copyright"].exists():
            raise SystemExit(f"bundle_licenses: {library['package']} has no copyright file")
        shutil.copy(library["copyright"], target / library["package"])


if __name__ == "__main__":
    main(*sys.argv[1:])
