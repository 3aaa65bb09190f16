"""Computes figures for the measurements of the viewer: memory and time of processes, sums of
requests, and differences of pictures."""

import contextlib
import mmap
import os
import re
from pathlib import Path

import numpy as np


def mapped(path):
    with open(path, "rb") as file:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def cpu_s(pid):
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident(pid, which="VmRSS"):
    """Resident memory in MiB; 0 if the process has ended."""
    with contextlib.suppress(OSError):
        found = re.search(
            rf"{which}:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
        )
        return int(found[1]) / 1024 if found else 0
    return 0


def descendants(kind):
    """Returns the pids of this process's descendants that are browser processes of this kind."""
    parents, commands = {}, {}
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            pid = int(folder.name)
            parents[pid] = int(
                (folder / "stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[1]
            )
            commands[pid] = (folder / "cmdline").read_bytes().decode(errors="replace")

    def is_ours(pid):
        while pid in parents and pid != os.getpid():
            pid = parents[pid]
        return pid == os.getpid()

    return [
        pid for pid, command in commands.items() if f"--type={kind}" in command and is_ours(pid)
    ]


def row(done):
    return {
        key: round(done[key], 3)
        for key in ("completeS", "doneS", "firstPictureS", "compileS", "coarsePixels")
    } | {
        key: done[key]
        for key in (
            "full",
            "width",
            "height",
            "tiles",
            "tileBytes",
            "poolBytes",
            "evicted",
            "fetchedBytes",
        )
    }


def sums(requests):
    """Returns the addresses of the requested tiles ("LEVEL.OFFSET"), and the received bytes of the
    page, the manifest and the tiles."""
    tiles, bytes_of = set(), {"page": 0, "manifest": 0, "tiles": 0}
    for address, _, _, size in requests:
        if single := re.search(r"/tiles/(\d+)/(\d+)\?", address):
            tiles.add(f"{single[1]}.{single[2]}")
        elif nodes := re.search(r"[?&]nodes=([0-9.,]+)", address):
            tiles.update(nodes[1].split(","))
        bytes_of[
            "page"
            if "/api/" not in address
            else "manifest"
            if address.endswith("/tiles")
            else "tiles"
        ] += size
    return tiles, bytes_of


def places_of(files, text):
    """Returns how many different tiles the rays of a picture traversed, and at how many positions
    in the grid. `text`: the finest cells of tiles that rays reached, as "LEVEL,X,Y,Z" words."""
    places = set()
    for place in text.split():
        level, *at = map(int, place.split(","))
        while level >= 0 and (level, *at) not in places:
            places.add((level, *at))
            above = max(0, level - 3)
            at, level = [x >> (level - above) for x in at], above if level > 0 else -1
    tiles = {}
    for level, *at in places:
        shift = files.levels - level
        offset = files.find([x << shift for x in at], level)
        if offset is not None:  # else it is a neighbor of the cell that was hit
            tiles[level, offset] = tiles.get((level, offset), 0) + 1
    return {
        "tiles_seen": len(tiles),
        "places_seen": sum(tiles.values()),
        "max_places": max(tiles.values()),
    }


def describe(histogram):
    total, cumulated = sum(histogram), np.cumsum(histogram)
    return {
        "rays": total,
        "mean": round(float(np.dot(histogram, np.arange(len(histogram)))) / max(1, total), 1),
        "p99": int(np.searchsorted(cumulated, 0.99 * total)),
        "max": int(np.max(np.nonzero(histogram)[0], initial=0)),
    }


def compared(depths, reference, ours, its):
    """Returns the brightness difference of the pixels that hit the scene, for the complete picture
    and for 8 x 8 regions of it."""
    ours_hit, its_hit = np.isfinite(depths), np.isfinite(reference)
    both, off = ours_hit & its_hit, (ours - its).mean(axis=2)
    regions = []
    for rows, marks in zip(np.array_split(off, 8), np.array_split(both, 8)):
        for part, mark in zip(np.array_split(rows, 8, axis=1), np.array_split(marks, 8, axis=1)):
            regions.append(round(float(part[mark].mean()), 1) if mark.sum() >= 100 else None)
    sky = ~ours_hit & ~its_hit
    return {
        "same_mask": round(float((ours_hit == its_hit).mean()), 5),
        "hits": round(float(both.mean()), 3),
        "mean_viewer": round(float(ours.mean(axis=2)[both].mean()), 1),
        "mean_render": round(float(its.mean(axis=2)[both].mean()), 1),
        "mean_off": round(float(off[both].mean()), 2),
        "rms": round(float(np.sqrt((off[both] ** 2).mean())), 1),
        "sky_off": round(float(off[sky].mean()), 2) if sky.any() else None,
        "region_off": max((r for r in regions if r is not None), key=abs),
        "regions": regions,
    }
