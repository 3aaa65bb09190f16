"""Builds one scene with several budgets, to test that --memory is never exceeded."""

import json
import os
import subprocess
import sys
import tempfile

MIB = 1 << 20
ALLOWANCE = 64 * MIB  # resident memory that --memory allows in addition to its value


def holds(build_command, budgets):
    """Runs `voxdag build` with each budget, in bytes, None for the default, and prints its costs.
    Returns True if the peak of resident memory, by the report and by the system's own measurement,
    was at most ALLOWANCE above each budget, and the files were equal."""
    digests, within = set(), True
    for memory in budgets:
        report, measured = _build(build_command, memory)
        peak = max(report["peak_rss_bytes"], measured)
        digests.add(report["sha256"])
        broken = memory is not None and peak > memory + ALLOWANCE
        within &= not broken
        given = f"{memory // MIB} MiB" if memory else "default"
        print(
            f"--memory {given:8} peak {peak / MIB:6.0f} MiB  wall {report['wall_s']:6.1f} s  "
            f"CPU {report['cpu_s']:6.1f} s  {report['voxels']} voxels"
            f"{'  TOO MUCH' if broken else ''}",
            flush=True,
        )
    if len(digests) != 1:
        print("the files differ")
    return within and len(digests) == 1


def _build(command, memory):
    """Returns the report, and the peak of resident memory that the system measured."""
    command = [*command, "--force", "--json", *(["--memory", str(memory)] if memory else [])]
    with tempfile.TemporaryFile() as out:
        process = subprocess.Popen(command, stdout=out)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            sys.exit(f"voxdag build: status {process.returncode}")
        out.seek(0)
        return json.load(out), usage.ru_maxrss * 1024
