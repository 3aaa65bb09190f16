"""Functions for the benchmarks: measure a command or a complete build, and print tables.

CPU time is the user and system time of the complete process tree. Wall time is the time from start
to exit. Peak memory is the largest resident set of any process of the tree.
"""

import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

REPO = Path(__file__).resolve().parent.parent
MIB = 1 << 20


@dataclass
class Run:
    """Cost and standard output of one command; for a build also the peak disk use of its folder."""

    wall_s: float
    cpu_s: float
    peak_rss_bytes: int
    stdout: str
    peak_disk_bytes: int = 0


def run(command):
    """Runs a command to its end; exits with its messages if it fails."""
    command = [str(part) for part in command]
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as messages:
        start = time.monotonic()
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=messages)
        _, status, usage = os.wait4(process.pid, 0)
        wall_s = time.monotonic() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        messages.seek(0)
        if process.returncode != 0:
            sys.exit(f"{' '.join(command)}\nfailed with {process.returncode}: {messages.read()}")
        cpu_s = usage.ru_utime + usage.ru_stime
        return Run(wall_s, cpu_s, usage.ru_maxrss * 1024, out.read())


class DiskWatch:
    """The peak disk use of a folder, sampled every 20 ms."""

    def __init__(self, folder):
        self.folder = folder
        self.peak_bytes = 0
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.watch)

    def sample(self):
        total = 0
        for folder, _, names in os.walk(self.folder):  # skips removed folders
            for name in names:
                with contextlib.suppress(FileNotFoundError):  # removed since it was listed
                    total += os.stat(os.path.join(folder, name)).st_blocks * 512
        self.peak_bytes = max(self.peak_bytes, total)

    def watch(self):
        while not self.stopped.wait(0.02):
            self.sample()

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stopped.set()
        self.thread.join()
        self.sample()


def build(voxdag, scene, resolution, scratch, *options):
    """Builds into an empty temporary folder; returns (Run, the report of the build)."""
    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        output = Path(folder) / "out.vdag"
        with DiskWatch(Path(folder)) as disk:
            taken = run(
                [voxdag, "build", scene, "-r", resolution, "-o", output, "--json", *options]
            )
        taken.peak_disk_bytes = disk.peak_bytes
        return taken, json.loads(taken.stdout)


def machine():
    """The machine and the time, for the header of a report."""
    model = next(
        (
            line.split(":", 1)[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if line.startswith("model name")
        ),
        os.uname().machine,
    )
    return {
        "cpu": model,
        "cores": len(os.sched_getaffinity(0)),
        "memory_bytes": os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"),
        "kernel": os.uname().release,
        "date": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
        "load_1min": os.getloadavg()[0],
    }


def machine_line(facts):
    return (
        f"{facts['cpu']}, {facts['cores']} cores, {facts['memory_bytes'] / 2**30:.0f} GiB, "
        f"Linux {facts['kernel']}, {facts['date']}, load {facts['load_1min']:.2f}"
    )


def median(values):
    return statistics.median(values)


def amount(value):
    """A count in three or four digits: 2.568 G, 212.5 M, 940 k."""
    for unit, scale in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= scale:
            return f"{value / scale:.4g} {unit}"
    return f"{value:.4g}"


def table(heads, rows):
    """A Markdown table with aligned columns, the first to the left, numbers to the right."""
    cells = [heads] + [[str(cell) for cell in row] for row in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(heads))]

    def line(row):
        padded = [row[0].ljust(widths[0])] + [c.rjust(w) for c, w in zip(row[1:], widths[1:])]
        return "| " + " | ".join(padded) + " |"

    rules = ["-" * widths[0]] + ["-" * (w - 1) + ":" for w in widths[1:]]
    return "\n".join([line(cells[0]), line(rules)] + [line(row) for row in cells[1:]])


def print_table(heads, rows):
    print(table(heads, rows), flush=True)


def add_common_options(parser):
    parser.add_argument(
        "--voxdag", type=Path, default=REPO / "build/cpu/voxdag", help="the program to measure"
    )
    parser.add_argument(
        "--scenes", type=Path, default=REPO / "../shared/scenes", help="folder of .glb scenes"
    )
    parser.add_argument(
        "--scratch",
        type=Path,
        default=None,
        help="folder for results and work folders (default: the system's)",
    )
    parser.add_argument("--json", type=Path, help="also write the values to this JSON file")


def write_json(path, figures):
    if path:
        path.write_text(json.dumps(figures, indent=2) + "\n")
