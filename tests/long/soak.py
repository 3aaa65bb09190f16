#!/usr/bin/env python3
"""Many clients use one service for a long time, and the service is killed repeatedly.

    tests/long/soak.py [--voxdag build/cpu/voxdag] [--minutes 60] [--clients 20] [--kill-every 5]
                       [--seed 1]

Each client repeats, chosen by its seed: upload a scene, submit a job, follow its events, download
and compare the result, cancel, suspend and resume, retry, delete. Every KILL-EVERY minutes the
service is killed (SIGKILL) and immediately started again on the same data. The script checks these
requirements:

  - The SHA-256 of a result, as the service reports it and as computed from the downloaded bytes, is
    the same as without a service.
  - No acknowledged job is lost, and no job fails.
  - Memory and file descriptors of the service do not grow from the first quarter to the last.

Prints a line per minute. The exit status is 1 if a requirement is violated.
"""

import argparse
import hashlib
import http.client
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

REQUEST_TIMEOUT_S = 60
JOB_TIMEOUT_S = 600
SCENES = {"menger": ["menger"], "city": ["city"], "terrain": ["terrain"]}
RESOLUTIONS = [256, 512, 1024]
ENDED = ("succeeded", "failed", "canceled")


class SoakError(Exception):
    """A requirement that the soak test checks is not met."""


class Service:
    """The service on one port and one data folder, over any number of kills."""

    def __init__(self, voxdag, folder):
        self.voxdag, self.folder = voxdag, folder
        self.port = 0
        self.log_path = folder / "service.log"
        self.stopping = False
        self.start()

    def start(self):
        begin = self.log_path.stat().st_size if self.log_path.exists() else 0
        with open(self.log_path, "a", encoding="utf-8") as log:
            self.process = subprocess.Popen(
                [self.voxdag, "serve", "--port", str(self.port), "--data", self.folder / "data"],
                stderr=log,
            )
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            text = self.log_path.read_text(encoding="utf-8")[begin:]
            if found := re.search(r"listening on http://[^:]+:(\d+)", text):
                self.port = int(found[1])
                return
            if self.process.poll() is not None:
                raise SoakError(f"the service ended with {self.process.returncode}: {text[-500:]}")
            time.sleep(0.02)
        raise SoakError("the service does not start within 60 s")

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.start()

    def usage(self):
        """Returns the service's resident memory in KiB and its number of open file descriptors."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return (
            int(re.search(r"VmRSS:\s+(\d+)", status)[1]),
            len(os.listdir(f"/proc/{self.process.pid}/fd")),
        )


class Client(threading.Thread):
    """One user. Requests that a kill breaks are repeated, as the API's documentation says."""

    def __init__(self, service, number, expected, scenes, until, counts, seed):
        super().__init__(daemon=True)
        self.service, self.number, self.expected, self.scenes = service, number, expected, scenes
        self.until, self.counts = until, counts
        self.random = random.Random(1000 * seed + number)
        self.failure = None

    def run(self):
        try:
            while time.monotonic() < self.until:
                self.one_job()
        except Exception as failure:  # pylint: disable=broad-except
            self.failure = f"client {self.number}: {type(failure).__name__}: {failure}"

    def count(self, what):
        with self.counts["lock"]:
            self.counts[what] = self.counts.get(what, 0) + 1

    def request(self, method, path, body=None, headers=None):
        """Returns status and bytes. Repeats requests without an answer or refused as busy."""
        deadline = time.monotonic() + JOB_TIMEOUT_S
        while True:
            try:
                connection = http.client.HTTPConnection(
                    "127.0.0.1", self.service.port, timeout=REQUEST_TIMEOUT_S
                )
                try:
                    connection.request(method, path, body, headers or {})
                    answer = connection.getresponse()
                    data = answer.read()
                finally:
                    connection.close()
                if answer.status not in (429, 503):
                    return answer.status, data
            except (OSError, http.client.HTTPException):
                self.count("repeated requests")
            if time.monotonic() > deadline:
                raise SoakError(f"{method} {path}: no answer for {JOB_TIMEOUT_S} s")
            time.sleep(0.2)

    def job(self, job_id):
        status, data = self.request("GET", f"/api/v1/jobs/{job_id}")
        if status != 200:
            raise SoakError(f"job {job_id} is lost: {status} {data[:200]}")
        return json.loads(data)

    def wait(self, job_id, states):
        deadline = time.monotonic() + JOB_TIMEOUT_S
        while time.monotonic() < deadline:
            job = self.job(job_id)
            if job["state"] in states:
                return job
            if job["state"] == "failed":
                raise SoakError(f"job {job_id} failed: {job['error']}")
            time.sleep(0.1)
        raise SoakError(f"job {job_id} is {job['state']} after {JOB_TIMEOUT_S} s")

    def follow(self, job_id):
        """Reads the event stream until it ends or breaks."""
        connection = http.client.HTTPConnection(
            "127.0.0.1", self.service.port, timeout=REQUEST_TIMEOUT_S
        )
        try:
            connection.request("GET", f"/api/v1/jobs/{job_id}/events")
            answer = connection.getresponse()
            while answer.read(4096):
                pass
        except (OSError, http.client.HTTPException):
            self.count("broken streams")
        finally:
            connection.close()

    def one_job(self):
        name, resolution = self.random.choice(sorted(self.scenes)), self.random.choice(RESOLUTIONS)
        scene = f"{name}-{self.random.randrange(4)}.glb"
        status, data = self.request("PUT", f"/api/v1/scenes/{scene}", self.scenes[name])
        if status not in (200, 201, 409):
            raise SoakError(f"upload: {status} {data[:200]}")
        if self.request("HEAD", f"/api/v1/scenes/{scene}")[0] == 404:
            return None
        key = f"{self.number}-{self.random.getrandbits(64):x}"
        body = json.dumps({"scene": scene, "resolution": resolution, "name": key})
        status, data = self.request(
            "POST",
            "/api/v1/jobs",
            body,
            {"Content-Type": "application/json", "Idempotency-Key": key},
        )
        if status == 404 or status == 409:
            return None
        if status != 202:
            raise SoakError(f"submit: {status} {data[:200]}")
        job_id = json.loads(data)["id"]
        self.count("jobs")
        plan = self.random.random()
        if plan < 0.15:
            self.request("POST", f"/api/v1/jobs/{job_id}/cancel")
            job = self.wait(job_id, ENDED)
            if job["state"] == "canceled" and plan < 0.07:
                self.request("POST", f"/api/v1/jobs/{job_id}/retry")
            elif job["state"] == "canceled":
                self.count("canceled")
                return self.remove(job_id)
        elif plan < 0.3:
            self.request("POST", f"/api/v1/jobs/{job_id}/suspend")
            self.wait(job_id, ("suspended",) + ENDED)
            self.request("POST", f"/api/v1/jobs/{job_id}/resume")
        elif plan < 0.6:
            self.follow(job_id)
        job = self.wait(job_id, ("succeeded",))
        status, dag = self.request("GET", f"/api/v1/jobs/{job_id}/dag")
        expected = self.expected[name, resolution]
        if status != 200 or hashlib.sha256(dag).hexdigest() != expected:
            raise SoakError(f"job {job_id}: the downloaded bytes differ from a local build")
        if job["result"]["sha256"] != expected:
            raise SoakError(f"job {job_id}: another SHA-256 than that of a local build")
        self.count("verified")
        return self.remove(job_id)

    def remove(self, job_id):
        status, data = self.request("DELETE", f"/api/v1/jobs/{job_id}")
        if status not in (204, 404):
            raise SoakError(f"delete {job_id}: {status} {data[:200]}")
        return


def prepare(voxdag, folder):
    """Returns the scenes' bytes, and the SHA-256 of the result for each scene and resolution."""
    scenes, expected = {}, {}
    for name, arguments in SCENES.items():
        path = folder / f"{name}.glb"
        subprocess.run([voxdag, "generate", *arguments, path], check=True, capture_output=True)
        scenes[name] = path.read_bytes()
        for resolution in RESOLUTIONS:
            built = subprocess.run(
                [
                    voxdag,
                    "build",
                    path,
                    "-r",
                    str(resolution),
                    "-o",
                    folder / f"{name}.vdag",
                    "--json",
                ],
                check=True,
                capture_output=True,
                text=True,
            )
            expected[name, resolution] = json.loads(built.stdout)["sha256"]
    return scenes, expected


def grew(samples, slack):
    """True if the median of the last quarter is more than `slack` times the first quarter's."""
    quarter = max(1, len(samples) // 4)
    first, last = sorted(samples[:quarter]), sorted(samples[-quarter:])
    return last[len(last) // 2] > slack * first[len(first) // 2]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag", type=Path)
    parser.add_argument("--minutes", default=60, type=float)
    parser.add_argument("--clients", default=20, type=int)
    parser.add_argument("--kill-every", default=5, type=float)
    parser.add_argument("--seed", default=1, type=int)
    arguments = parser.parse_args()
    voxdag = arguments.voxdag.resolve()
    with tempfile.TemporaryDirectory(prefix="voxdag-soak-") as name:
        return soak(voxdag, Path(name), arguments)


def soak(voxdag, folder, arguments):
    scenes, expected = prepare(voxdag, folder)
    service = Service(voxdag, folder)
    begin = time.monotonic()
    counts = {"lock": threading.Lock()}
    clients = [
        Client(
            service,
            number,
            expected,
            scenes,
            begin + 60 * arguments.minutes,
            counts,
            arguments.seed,
        )
        for number in range(arguments.clients)
    ]
    for client in clients:
        client.start()
    memory, files, kills = [], [], 0
    next_kill, next_line = begin + 60 * arguments.kill_every, begin
    while any(client.is_alive() for client in clients):
        now = time.monotonic()
        if service.process.poll() is not None:
            raise SoakError(f"the service ended by itself with {service.process.returncode}")
        if now >= next_line:
            next_line += 60
            rss_kib, descriptors = service.usage()
            if now - begin > 60:  # Clients have connected.
                memory.append(rss_kib)
                files.append(descriptors)
            shown = {k: v for k, v in sorted(counts.items()) if k != "lock"}
            print(
                f"{(now - begin) / 60:5.0f} min  {rss_kib / 1024:6.1f} MiB  {descriptors:4} files  "
                f"{kills} kills  {shown}",
                flush=True,
            )
        if now >= next_kill:
            next_kill += 60 * arguments.kill_every
            service.kill()
            kills += 1
        time.sleep(0.1)
    failures = [client.failure for client in clients if client.failure]
    if memory and grew(memory, 1.5):
        failures.append(f"resident memory grows: {memory} KiB")
    if files and grew(files, 1.5):
        failures.append(f"open files grow: {files}")
    service.process.send_signal(signal.SIGTERM)
    if service.process.wait(timeout=60) != 0:
        failures.append(f"SIGTERM: exit status {service.process.returncode}")
    shown = {k: v for k, v in sorted(counts.items()) if k != "lock"}
    print(
        f"seed {arguments.seed}: {arguments.minutes:g} minutes, {kills} kills, {shown}, "
        f"{len(failures)} failures"
    )
    for failure in failures:
        print("FAILED ", failure)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
