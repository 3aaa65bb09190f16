#!/usr/bin/env python3
"""Measures how much a package of `voxdag publish` transfers, in headless Chromium with WebGL on
the CPU.

    bench/viewer/package.py DIR [--size 1280x720] [--views VIEWS] [--list]

Serves the folder DIR with support for range requests and without compression. Prints the requests
and the received bytes until the first picture, in which no cell is wider than 16 pixels. With
--views, also shows the views of the file VIEWS one after the other in the same page, and prints the
requests and bytes of each. A line of VIEWS has a name and the camera options of `voxdag render`,
such as in sponza.txt in this folder. --list also prints each request. Bytes are the bodies of
answers, without header fields.

Requests and bytes depend a little on the speed of the machine, because the page requests the tiles
that are missing in the pictures it has drawn so far. Needs Playwright.
"""

import argparse
import contextlib
import json
import os
import re
import sys
import tempfile
import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "tests" / "browser"))

from in_page import FIRST, IN_LARGE_PARTS, UNTIL_COMPLETE  # noqa: E402
from measure import OPTIONS, STEP_MS, WINDOW  # noqa: E402
from visitor import Visitor  # noqa: E402

RANGE = re.compile(r"bytes=(\d+)-(\d+)$")


class Handler(SimpleHTTPRequestHandler):
    """Serves a folder, and adds each request to `requests` as (time in ms, path, range, bytes)."""

    protocol_version = "HTTP/1.1"

    def __init__(self, *arguments, requests, **options):
        self.requests = requests
        super().__init__(*arguments, **options)

    def log_message(self, *_):
        pass

    def do_GET(self):
        path, now = self.path.split("?")[0], 1000 * time.time()
        asked = RANGE.match(self.headers.get("Range", ""))
        try:
            with open(self.translate_path("/index.html" if path == "/" else path), "rb") as file:
                size = os.fstat(file.fileno()).st_size
                begin = int(asked[1]) if asked else 0
                end = min(int(asked[2]) + 1, size) if asked else size
                file.seek(begin)
                body = file.read(end - begin)
        except OSError:
            return self.send_error(404)
        self.requests.append((now, path, asked[0] if asked else "", len(body)))
        self.send_response(206 if asked else 200)
        self.send_header("Content-Type", self.guess_type(self.path if path != "/" else "i.html"))
        self.send_header("Content-Length", str(len(body)))
        if asked:
            self.send_header("Content-Range", f"bytes {begin}-{end - 1}/{size}")
        self.end_headers()
        with contextlib.suppress(ConnectionError):  # the page no longer needs the answer
            self.wfile.write(body)
        return None


@contextlib.contextmanager
def served(folder):
    """Yields the URL of a server of the folder, and the list of its requests."""
    requests = []
    server = ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(Handler, directory=str(folder), requests=requests)
    )
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}", requests
    finally:
        server.shutdown()
        server.server_close()


def kind_of(path):
    """Returns the kind of a file of a package: the part of its name before the hash."""
    return "packs" if path.startswith("/packs/") else re.split(r"[-.]", path[1:] or "index")[0]


def summary(requests):
    kinds = {}
    for _, path, _, size in requests:
        kinds[kind_of(path)] = kinds.get(kind_of(path), 0) + size
    return {"requests": len(requests), "bytes": sum(each[3] for each in requests), **kinds}


def say(**values):
    print(json.dumps({**values, "load": round(os.getloadavg()[0], 1)}), flush=True)


def show_list(requests):
    begin = requests[0][0] if requests else 0
    for now, path, asked, size in requests:
        print(f"  {now - begin:8.0f} ms  {size:9,}  {path} {asked}", flush=True)


def measure(visitor, url, requests, views, is_listed):
    visitor.page.goto(f"{url}/", wait_until="commit")
    first = None
    while first is None:
        visitor.page.wait_for_timeout(50)
        first = visitor.page.evaluate(FIRST)
    origin = visitor.page.evaluate("performance.timeOrigin")
    before = [each for each in requests if each[0] <= origin + first["first"]]
    say(view="first picture", ms=round(first["first"]), tiles=first["tiles"], **summary(before))
    if is_listed:
        show_list(before)
    seen = 0
    for name, camera in views:
        visitor.page.evaluate(IN_LARGE_PARTS)
        done = visitor.page.evaluate(UNTIL_COMPLETE, [camera, True])
        new, seen = requests[seen:], len(requests)
        say(view=name, s=round(done["doneS"]), tiles=done["tiles"], **summary(new))
        if is_listed:
            show_list(new)
    if views:
        say(view="all", **summary(requests))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder")
    parser.add_argument("--views", help="a file of names and cameras")
    parser.add_argument("--size", default="1280x720", help="of the canvas")
    parser.add_argument("--list", action="store_true", help="also print each request")
    arguments = parser.parse_args()
    from playwright.sync_api import sync_playwright

    width, height = map(int, arguments.size.split("x"))
    views = []
    if arguments.views:
        lines = Path(arguments.views).read_text(encoding="utf-8").splitlines()
        views = [line.split(" ", 1) for line in lines if line.strip()]
    with (
        tempfile.TemporaryDirectory(prefix="measure-package-") as folder,
        served(arguments.folder) as (url, requests),
        sync_playwright() as play,
    ):
        browser = play.chromium.launch(executable_path="/usr/bin/chromium", args=OPTIONS)
        visitor = Visitor(
            browser, Path(folder), "package", width + WINDOW[0], height + WINDOW[1],
            device_scale_factor=1,
        )  # fmt: skip
        visitor.timeout_ms = STEP_MS
        visitor.context.set_default_timeout(STEP_MS)
        measure(visitor, url, requests, views, arguments.list)
        browser.close()


if __name__ == "__main__":
    main()
