#!/usr/bin/env python3
"""Builds the container image and writes it as an archive that `docker load` accepts:

    packaging/release/make_image.py VERSION OUTPUT.tar.gz

Uses docker if its service answers. Otherwise it uses buildah as root, on a base image made by
debootstrap, so it needs a mirror of Debian but no registry. The exit status is 3 if this machine
has neither; the last line of the output is then the reason.
"""

import argparse
import gzip
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
MIRROR = "http://deb.debian.org/debian"
CANNOT = 3
# The parts of a package that images of Debian leave out, as `debian:bookworm-slim` does.
SLIM = """\
path-exclude /usr/share/doc/*
path-include /usr/share/doc/*/copyright
path-exclude /usr/share/info/*
path-exclude /usr/share/lintian/*
path-exclude /usr/share/locale/*
path-exclude /usr/share/man/*
"""
NO_CACHE = """\
APT::Keep-Downloaded-Packages "false";
Dir::Cache::pkgcache "";
Dir::Cache::srcpkgcache "";
"""


def run(*command, **options):
    print("$", *command, flush=True)
    return subprocess.run([str(word) for word in command], check=True, **options)


def output_of(*command):
    return run(*command, stdout=subprocess.PIPE, text=True).stdout.strip()


def docker_fault():
    """Returns why docker cannot build images here, or None if it can."""
    if not shutil.which("docker"):
        return "no docker"
    done = subprocess.run(
        ["docker", "version", "--format", "{{.Server.Version}}"], capture_output=True, text=True
    )
    if done.returncode == 0:
        return None
    return "docker does not work: " + (done.stderr or done.stdout).strip().replace("\n", " ")


def buildah_fault():
    """Returns why buildah cannot build images here, or None if it can."""
    missing = [tool for tool in ("buildah", "debootstrap") if not shutil.which(tool)]
    if missing:
        return f"no {' and no '.join(missing)}: apt-get install buildah debootstrap"
    return None if os.geteuid() == 0 else "buildah needs root here"


class Buildah:
    """Images that buildah stores in a folder, apart from the other images of this machine."""

    def __init__(self, folder):
        self.command = ["buildah", "--storage-driver", "vfs"]
        self.command += ["--root", folder / "storage", "--runroot", folder / "run"]

    def run(self, *arguments, **options):
        return run(*self.command, *arguments, **options)

    def output_of(self, *arguments):
        return output_of(*self.command, *arguments)

    def add_base(self, tree, name):
        """Makes an image of a root file system."""
        scratch = self.output_of("from", "scratch")
        self.run("add", "--quiet", scratch, tree, "/", stdout=subprocess.DEVNULL)
        self.run("commit", "--quiet", "--rm", scratch, name)


def make_base(folder, suite):
    """Returns a minimal root file system of Debian. `folder` keeps it for later calls."""
    base = folder / f"base-{suite}"
    if base.exists():
        return base
    unfinished = folder / f"base-{suite}.part"
    shutil.rmtree(unfinished, ignore_errors=True)
    run("debootstrap", "--variant=minbase", suite, unfinished, MIRROR)
    (unfinished / "etc/dpkg/dpkg.cfg.d/voxdag-slim").write_text(SLIM)
    (unfinished / "etc/apt/apt.conf.d/voxdag-no-cache").write_text(NO_CACHE)
    # Debootstrap copies these two from this machine; a container has its own.
    for name in ("hostname", "resolv.conf"):
        (unfinished / "etc" / name).unlink(missing_ok=True)
    for name in ("var/cache/apt", "var/lib/apt/lists", "var/log"):
        for path in (unfinished / name).rglob("*"):
            if path.is_file():
                path.unlink()
    for name in ("doc", "info", "lintian", "locale", "man"):
        for path in (unfinished / "usr/share" / name).rglob("*"):
            if path.name != "copyright" and not path.is_dir():
                path.unlink()
    unfinished.rename(base)
    return base


def build_with_buildah(version, archive, folder, suite):
    """Writes the image's archive, uncompressed. Leaves the base image's files in `folder`."""
    with tempfile.TemporaryDirectory(dir=folder, prefix="buildah-") as storage:
        buildah = Buildah(Path(storage))
        base, image = "localhost/voxdag-base", f"docker.io/library/voxdag:{version}"
        buildah.add_base(make_base(folder, suite), base)
        # Only docker's image format can store a HEALTHCHECK.
        buildah.run(
            *("bud", "--isolation", "chroot", "--pull-never", "--format", "docker"),
            *("--build-arg", f"BUILD_BASE={base}", "--build-arg", f"RUN_BASE={base}"),
            *("--build-arg", f"VERSION={version}", "--tag", image, ROOT),
        )
        buildah.run("push", "--quiet", image, f"docker-archive:{archive}:voxdag:{version}")


def build_with_docker(version, archive):
    """Writes the image's archive, uncompressed."""
    run("docker", "build", "--tag", f"voxdag:{version}", "--build-arg", f"VERSION={version}", ROOT)
    run("docker", "save", "--output", archive, f"voxdag:{version}")


def compress(archive, output):
    unfinished = output.with_name(output.name + ".part")
    # Without a name and a time, equal archives have equal compressed bytes.
    with (
        archive.open("rb") as source,
        unfinished.open("wb") as target,
        gzip.GzipFile("", "wb", 6, target, mtime=0) as packed,
    ):
        shutil.copyfileobj(source, packed, 1 << 20)
    unfinished.rename(output)


def make_image(version, output, folder, suite="bookworm", can_use_docker=True):
    """Writes the compressed archive of the image to `output`. Returns a reason if it cannot."""
    docker = docker_fault() if can_use_docker else "docker is not used"
    buildah = buildah_fault()
    if docker and buildah:
        return f"{docker}; {buildah}"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix="archive-") as scratch:
        archive = Path(scratch) / "image.tar"
        if docker:
            print(f"{docker}, so buildah makes the image", flush=True)
            build_with_buildah(version, archive, folder, suite)
        else:
            build_with_docker(version, archive)
        compress(archive, output)
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("version")
    parser.add_argument("output", type=Path)
    arguments = parser.parse_args()
    reason = make_image(arguments.version, arguments.output, ROOT / "build/image")
    if reason:
        print(reason)
        sys.exit(CANNOT)


if __name__ == "__main__":
    main()
