#!/usr/bin/env python3
"""Runs nginx with the configuration of docs/operating.md, and uses a service through it.

    tests/long/behind_nginx.py [--voxdag build/cpu/voxdag] [--seed 1]

Checks these requirements, over TLS and through the proxy:

  - uploads reach the service while they are being sent; parts, checksums and refusals work;
  - events of a job arrive one by one, not at the end of the stream;
  - ranges, validators, compressed tiles and HEAD are answered as by the service;
  - the commands submit, watch, jobs and download work;
  - a slow client is closed, and too many connections of one address are refused with 429;
  - a restarted service is used again.

Prints a line per check. The exit status is 1 if a requirement is violated.
"""

import argparse
import base64
import hashlib
import http.client
import json
import random
import re
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HTTP_TIMEOUT_S = 60
MAX_START_S = 30
RESOLUTION = 1024
SLOW_RESOLUTION = 8192


def documented_configuration():
    """Returns the configuration for nginx in docs/operating.md."""
    text = (ROOT / "docs/operating.md").read_text(encoding="utf-8")
    section = text[text.index("## Reverse proxy") :]
    block = re.search(
        r"((?:^    .*\n|^\n)+)", section[section.index("    limit_conn_zone") :], re.M
    )
    return re.sub(r"^    ", "", block[1], flags=re.M)


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def until(condition, seconds, what):
    deadline = time.monotonic() + seconds
    while not (result := condition()):
        if time.monotonic() > deadline:
            raise AssertionError(f"{what}: not within {seconds} s")
        time.sleep(0.05)
    return result


def is_open(port):
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


class Proxied:
    """A service with a token, and nginx in front of it."""

    def __init__(self, voxdag, folder):
        self.voxdag, self.folder = voxdag, folder
        self.service_port, self.port = free_port(), free_port()
        made = subprocess.run(
            [voxdag, "token", "--role", "submit", "--name", "anna"],
            check=True,
            capture_output=True,
            text=True,
        )
        (folder / "tokens").write_text(made.stdout)
        self.token = re.search(r"\S{20,}", made.stderr)[0]
        (folder / "token").write_text(self.token)
        self.make_certificate()
        self.context = ssl.create_default_context(cafile=folder / "tls.crt")
        self.start_service()
        self.start_nginx()

    def make_certificate(self):
        subprocess.run(
            ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2"]
            + ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
            + ["-keyout", self.folder / "tls.key", "-out", self.folder / "tls.crt"],
            check=True,
            capture_output=True,
        )

    def start_service(self):
        with open(self.folder / "service.log", "a", encoding="utf-8") as log:
            self.service = subprocess.Popen(
                [self.voxdag, "serve", "--port", str(self.service_port)]
                + ["--data", self.folder / "data", "--tokens", self.folder / "tokens"],
                stderr=log,
            )
        until(lambda: is_open(self.service_port), MAX_START_S, "the service listens")

    def start_nginx(self):
        text = documented_configuration()
        changes = {
            "127.0.0.1:8080": f"127.0.0.1:{self.service_port}",
            "listen 443": f"listen 127.0.0.1:{self.port}",
            "voxdag.example.org": "localhost",
            "/etc/ssl/voxdag": str(self.folder / "tls"),
        }
        for old, new in changes.items():
            if old not in text:
                raise AssertionError(f"docs/operating.md: expected '{old}' in the configuration")
            text = text.replace(old, new)
        paths = "".join(
            f"{kind}_temp_path {self.folder}/{kind};\n"
            for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        )
        configuration = self.folder / "nginx.conf"
        configuration.write_text(
            f"daemon off;\nmaster_process off;\npid {self.folder}/nginx.pid;\n"
            f"error_log {self.folder}/nginx.log;\nevents {{ worker_connections 1024; }}\n"
            f"http {{\naccess_log off;\n{paths}{text}}}\n"
        )
        self.nginx = subprocess.Popen(["nginx", "-c", configuration, "-p", self.folder])
        until(lambda: is_open(self.port), MAX_START_S, "nginx listens")

    def stop(self):
        for process in (self.nginx, self.service):
            process.terminate()
            process.wait(timeout=60)

    def connect(self):
        return http.client.HTTPSConnection(
            "localhost", self.port, timeout=HTTP_TIMEOUT_S, context=self.context
        )

    def headers(self, more=None):
        return {"Authorization": f"Bearer {self.token}"} | (more or {})

    def request(self, method, path, body=None, headers=None):
        """Returns status, header fields and bytes of the answer."""
        connection = self.connect()
        try:
            connection.request(method, path, body, self.headers(headers))
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            connection.close()

    def json(self, method, path, body=None):
        text = None if body is None else json.dumps(body)
        status, _, data = self.request(method, path, text, {"Content-Type": "application/json"})
        assert status < 300, (method, path, status, data)
        return json.loads(data)

    def run(self, *arguments):
        return subprocess.run(
            [self.voxdag, *arguments, "--server", f"https://localhost:{self.port}"]
            + ["--token-file", self.folder / "token", "--ca-file", self.folder / "tls.crt"],
            check=True,
            capture_output=True,
            text=True,
        ).stdout


class Checks:
    def __init__(self, proxied, scene, seed):
        self.proxied, self.scene = proxied, scene
        self.data = scene.read_bytes()
        self.random = random.Random(seed)

    def job(self, resolution=RESOLUTION):
        request = {"scene": "a.glb", "resolution": resolution}
        return self.proxied.json("POST", "/api/v1/jobs", request)["id"]

    def check_upload(self):
        """The service stores the first bytes of a chunked body before the last are sent."""
        connection = self.proxied.connect()
        connection.putrequest("PUT", "/api/v1/scenes/a.glb")
        for name, value in self.proxied.headers({"Transfer-Encoding": "chunked"}).items():
            connection.putheader(name, value)
        connection.endheaders()
        sent = 0
        while sent < len(self.data) // 2:
            piece = self.data[sent : sent + self.random.randint(1, 60000)]
            connection.send(b"%x\r\n%s\r\n" % (len(piece), piece))
            sent += len(piece)
        received = until(self.stored_bytes, 15, "the service has the first bytes")
        rest = self.data[sent:]
        connection.send(b"%x\r\n%s\r\n0\r\n\r\n" % (len(rest), rest))
        answer = connection.getresponse()
        scene = json.loads(answer.read())
        assert answer.status == 201, answer.status
        assert scene["sha256"] == hashlib.sha256(self.data).hexdigest(), scene
        return f"{received} of {len(self.data)} bytes before the end"

    def stored_bytes(self):
        part = self.proxied.folder / "data/scenes/parts/a.glb"
        return part.exists() and part.stat().st_size

    def check_upload_in_parts(self):
        size, first = len(self.data), 0
        while first < size:
            last = min(size, first + self.random.randint(1, size // 2)) - 1
            part = self.data[first : last + 1]
            digest = base64.b64encode(hashlib.sha256(part).digest()).decode()
            status, _, data = self.proxied.request(
                "PUT",
                "/api/v1/scenes/b.glb",
                part,
                {
                    "Content-Range": f"bytes {first}-{last}/{size}",
                    "Content-Digest": f"sha-256=:{digest}:",
                },
            )
            assert status == (201 if last + 1 == size else 202), (status, data)
            first = last + 1
        assert json.loads(data)["sha256"] == hashlib.sha256(self.data).hexdigest()

    def check_refusals(self):
        """A client that is still sending a body gets the refusal that the service sends before it
        reads it."""
        for headers, path, expected in (
            ({"Authorization": "Bearer wrong"}, "/api/v1/scenes/c.glb", 401),
            ({}, "/api/v1/scenes/c.unknown", 400),
            ({"Content-Encoding": "gzip"}, "/api/v1/scenes/c.glb", 415),
        ):
            status, _, data = self.proxied.request("PUT", path, self.data, headers)
            assert status == expected, (expected, status, data[:200])
        status, _, _ = self.proxied.request("GET", "/api/v1/jobs/0000000000000000")
        assert status == 404, status

    def check_events(self):
        """The first events arrive long before the job's end, each as soon as it is sent."""
        job = self.job(SLOW_RESOLUTION)
        connection = self.proxied.connect()
        connection.request("GET", f"/api/v1/jobs/{job}/events", headers=self.proxied.headers())
        answer = connection.getresponse()
        assert answer.headers["Content-Type"] == "text/event-stream"
        times, end = [], None
        while line := answer.readline():
            if line.startswith(b"event:"):
                times.append((time.monotonic(), line.split()[1].decode()))
                end = times[-1][1]
        assert end == "end", end
        gap = times[-1][0] - times[0][0]
        distinct = sum(b[0] - a[0] > 0.2 for a, b in zip(times, times[1:]))
        assert gap > 0.5 and distinct >= 2, times
        state = self.proxied.json("GET", f"/api/v1/jobs/{job}")["state"]
        assert state == "succeeded", state
        return f"{len(times)} events in {gap:.1f} s"

    def check_results(self):
        job = self.job()
        until(
            lambda: self.proxied.json("GET", f"/api/v1/jobs/{job}")["state"] == "succeeded",
            120,
            "the job succeeds",
        )
        path = f"/api/v1/jobs/{job}/dag"
        status, headers, dag = self.proxied.request("GET", path)
        sha256 = self.proxied.json("GET", f"/api/v1/jobs/{job}")["result"]["sha256"]
        assert status == 200 and hashlib.sha256(dag).hexdigest() == sha256
        first = self.random.randrange(len(dag) - 100)
        status, _, part = self.proxied.request(
            "GET", path, None, {"Range": f"bytes={first}-{first + 99}"}
        )
        assert status == 206 and part == dag[first : first + 100], status
        status, _, _ = self.proxied.request("GET", path, None, {"Range": f"bytes={len(dag)}-"})
        assert status == 416, status
        status, _, _ = self.proxied.request("GET", path, None, {"If-None-Match": headers["ETag"]})
        assert status == 304, status
        status, head, _ = self.proxied.request("HEAD", path)
        assert status == 200 and int(head["Content-Length"]) == len(dag), (status, head)
        status, head, _ = self.proxied.request(
            "GET", f"/api/v1/jobs/{job}/tiles", None, {"Accept-Encoding": "gzip"}
        )
        assert status == 200 and head.get("Content-Encoding") == "gzip", (status, head)

    def check_commands(self):
        shown = json.loads(
            self.proxied.run("submit", self.scene, "-r", str(RESOLUTION), "--wait", "--json")
        )
        assert shown["state"] == "succeeded", shown
        assert shown["id"] in self.proxied.run("jobs")
        output = self.proxied.folder / "downloaded.vdag"
        self.proxied.run("download", shown["id"], "-o", output)
        assert hashlib.sha256(output.read_bytes()).hexdigest() == shown["result"]["sha256"]

    def check_restart(self):
        """A kept connection of the proxy does not outlive the service."""
        self.proxied.json("GET", "/api/v1/jobs")
        self.proxied.service.terminate()
        assert self.proxied.service.wait(timeout=60) == 0
        assert self.proxied.request("GET", "/healthz")[0] == 502
        self.proxied.start_service()
        until(lambda: self.proxied.request("GET", "/healthz")[0] == 200, 15, "the service is back")

    def check_pauses(self):
        """Requests after pauses around the time limits of kept connections are answered."""
        for pause_s in (19, 21, 31):
            self.proxied.json("GET", "/api/v1/jobs")
            time.sleep(pause_s)
            status, _, _ = self.proxied.request(
                "POST", "/api/v1/jobs", "{}", {"Content-Type": "application/json"}
            )
            assert status == 400, (pause_s, status)

    def check_many_connections(self):
        """One address has at most 128 requests in progress. Further ones are refused."""
        slow = []
        try:
            for _ in range(160):
                client = self.context_socket()
                client.sendall(
                    b"PUT /api/v1/scenes/d.glb HTTP/1.1\r\nHost: localhost\r\n"
                    b"Authorization: Bearer " + self.proxied.token.encode() + b"\r\n"
                    b"Content-Length: 100000\r\n\r\nx"
                )
                slow.append(client)
            assert self.proxied.request("GET", "/healthz")[0] == 429
        finally:
            for client in slow:
                client.close()
        until(lambda: self.proxied.request("GET", "/healthz")[0] == 200, 30, "they are gone")

    def context_socket(self):
        plain = socket.create_connection(("127.0.0.1", self.proxied.port), timeout=HTTP_TIMEOUT_S)
        return self.proxied.context.wrap_socket(plain, server_hostname="localhost")

    def check_slow_clients(self):
        """The proxy closes a connection whose header does not end within client_header_timeout."""
        client = self.context_socket()
        client.sendall(b"GET /healthz HTTP/1.1\r\n")
        begin = time.monotonic()
        answer = client.recv(4096)
        assert not answer or b" 408 " in answer or b" 400 " in answer, answer
        assert time.monotonic() - begin < 20
        client.close()

    def run(self):
        failures = 0
        for name in (n for n in vars(Checks) if n.startswith("check_")):
            begin = time.monotonic()
            try:
                found = getattr(self, name)() or ""
                result = f"ok      {name[6:]} {time.monotonic() - begin:.1f} s {found}"
            except Exception as failure:  # pylint: disable=broad-except
                failures += 1
                result = f"FAILED  {name[6:]}: {type(failure).__name__}: {failure}"
            print(result, flush=True)
        return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--voxdag", default="build/cpu/voxdag", type=Path)
    parser.add_argument("--seed", default=1, type=int)
    options = parser.parse_args()
    if not shutil.which("nginx"):
        print("behind_nginx.py: no nginx here: expected it in PATH", file=sys.stderr)
        return 1
    voxdag = options.voxdag.resolve()
    with tempfile.TemporaryDirectory(prefix="voxdag-nginx-") as name:
        folder = Path(name)
        scene = folder / "scene.glb"
        subprocess.run(
            [voxdag, "generate", "terrain", scene, "--triangles", "200000"],
            check=True,
            capture_output=True,
        )
        proxied = Proxied(voxdag, folder)
        try:
            failures = Checks(proxied, scene, options.seed).run()
        finally:
            proxied.stop()
    print(f"seed {options.seed}: {failures} failed checks")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
