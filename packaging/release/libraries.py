"""The libraries that a program contains or loads, with their Debian packages and licenses."""

import functools
import re
import subprocess
from pathlib import Path

# The sources of the compiler, the C library and Python. Their headers are part of every program.
TOOLCHAIN = re.compile(r"gcc-.*|glibc|linux|python3.*|nvidia-.*|cuda-.*")


def output_of(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else ""


def linked_files(binary):
    """Returns the paths of the libraries that the loader loads with a program or a library."""
    paths = re.findall(r"=> (/\S+)", output_of("ldd", binary))
    return sorted({Path(path).resolve() for path in paths})


def owners(paths):
    """Returns {path: package}. Files without a package are left out."""
    found = {}
    aliases = {}
    for path in paths:
        # On systems with a merged /usr, dpkg's database can have either name of a file.
        aliases[str(path)] = path
        if str(path).startswith("/usr/lib"):
            aliases[str(path)[len("/usr") :]] = path
    names = sorted(aliases)
    for start in range(0, len(names), 500):
        done = subprocess.run(
            ["dpkg-query", "-S", *names[start : start + 500]], capture_output=True, text=True
        )
        for line in done.stdout.splitlines():
            packages, _, name = line.partition(": ")
            if name in aliases and not packages.startswith("diversion "):
                found[aliases[name]] = packages.split(",")[0]
    return found


@functools.cache
def facts(package):
    """Returns the version of an installed package, its architecture and the name of its source."""
    form = "${Version}\t${Architecture}\t${source:Package}"
    version, architecture, source = output_of("dpkg-query", "-W", "-f", form, package).split("\t")
    return version, architecture, source


def copyright_file(package):
    return Path("/usr/share/doc") / package.split(":")[0] / "copyright"


def licenses(package):
    """Returns the names of the licenses in the copyright file of a package."""
    file = copyright_file(package)
    if not file.exists():
        return []
    names = re.findall(r"^License:[ \t]*(\S.*?)[ \t]*$", file.read_text("utf-8"), re.MULTILINE)
    return sorted(set(names))


def library(package, is_linked, files=()):
    version, architecture, source = facts(package)
    return {
        "package": package.split(":")[0],
        "version": version,
        "architecture": architecture,
        "source": source,
        "licenses": licenses(package),
        "copyright": copyright_file(package),
        "files": sorted(str(file) for file in files),
        "is_linked": is_linked,
    }


def linked_libraries(binary):
    """Returns the packages of the libraries that a program loads, also indirectly."""
    packages = {}
    for path, package in owners(linked_files(binary)).items():
        packages.setdefault(package, []).append(path)
    return [library(package, True, files) for package, files in sorted(packages.items())]


def compiled_libraries(build, linked_sources):
    """Returns the packages whose headers were compiled in the folder `build`. Packages are left out
    if they were made from one of the sources `linked_sources`."""
    text = output_of("ninja", "-C", build, "-t", "deps")
    headers = {Path(name) for name in re.findall(r"^ {4}(/usr/\S+)$", text, re.MULTILINE)}
    sources = {package: facts(package)[2] for package in owners(headers).values()}
    return [
        library(package, False)
        for package, source in sorted(sources.items())
        if source not in linked_sources and not TOOLCHAIN.fullmatch(source)
    ]


def libraries(binary, build):
    """Returns all libraries of a program that was built in the folder `build`."""
    linked = linked_libraries(binary)
    if not linked:
        raise SystemExit(f"{binary}: ldd and dpkg find no libraries: expected Debian or Ubuntu")
    return linked + compiled_libraries(build, {library["source"] for library in linked})
