#!/usr/bin/env python3
"""Writes the SBOM (software bill of materials) of a release, in CycloneDX 1.5:

    packaging/release/make_sbom.py VERSION OUTPUT NAME=BINARY=BUILD...

NAME is a part of the release, such as wheel. BINARY is one of its programs or libraries, and BUILD
is the folder in which it was built. Each library is listed once, with its Debian version and
licenses, and with the parts that use it: "linked", or "compiled" for headers.
"""

import json
import subprocess
import sys
import urllib.parse
import uuid
from datetime import datetime, timezone

import libraries


def commit():
    """Returns the commit of the sources and its time."""
    done = subprocess.run(["git", "log", "-1", "--format=%H %ct"], capture_output=True, text=True)
    name, seconds = done.stdout.split() if done.returncode == 0 else ("unknown", 0)
    return name, datetime.fromtimestamp(int(seconds), timezone.utc).isoformat()


def distribution():
    values = {}
    with open("/etc/os-release", encoding="utf-8") as file:
        for line in file:
            name, _, value = line.strip().partition("=")
            values[name] = value.strip('"')
    return values.get("ID", "linux"), values.get("VERSION_ID", "")


def component(library, uses):
    system, release = distribution()
    version = urllib.parse.quote(library["version"], safe=":~")
    place = f"pkg:deb/{system}/{library['package']}@{version}"
    purl = f"{place}?arch={library['architecture']}&distro={system}-{release}"
    return {
        "type": "library",
        "bom-ref": purl,
        "name": library["package"],
        "version": library["version"],
        "purl": purl,
        "licenses": [{"license": {"name": name}} for name in library["licenses"]],
        "properties": [{"name": "voxdag:source-package", "value": library["source"]}]
        + [{"name": f"voxdag:{name}", "value": use} for name, use in sorted(uses.items())],
    }


def bill(version, parts):
    found, uses = {}, {}
    for part in parts:
        name, binary, build = part.split("=")
        for library in libraries.libraries(binary, build):
            found[library["package"]] = library
            use = "linked" if library["is_linked"] else "compiled"
            # A part can consist of several binaries.
            if uses.setdefault(library["package"], {}).get(name) != "linked":
                uses[library["package"]][name] = use
    components = [component(found[package], uses[package]) for package in sorted(found)]
    revision, time = commit()
    product = f"pkg:generic/voxdag@{version}"
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, f'voxdag {revision} {parts}')}",
        "version": 1,
        "metadata": {
            "timestamp": time,
            "component": {
                "type": "application",
                "bom-ref": product,
                "name": "voxdag",
                "version": version,
                "purl": product,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
                "properties": [{"name": "voxdag:commit", "value": revision}],
            },
        },
        "components": components,
        "dependencies": [{"ref": product, "dependsOn": [item["bom-ref"] for item in components]}],
    }


def main(version, output, *parts):
    sbom = bill(version, parts)
    with open(output, "w", encoding="utf-8") as file:
        json.dump(sbom, file, indent=2)
        file.write("\n")
    print(f"{len(sbom['components'])} libraries")


if __name__ == "__main__":
    main(*sys.argv[1:])
