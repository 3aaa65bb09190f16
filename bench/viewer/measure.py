#!/usr/bin/env python3
"""Measures the cost of the viewer, in headless Chromium with WebGL on the CPU.

    bench/viewer/measure.py views FILE.vdag [--budget MIB]
    bench/viewer/measure.py session FILE.vdag [--budget MIB]
    bench/viewer/measure.py pictures FILE.vdag
    bench/viewer/measure.py frames FILE.vdag --other WEB
    bench/viewer/measure.py first FILE.vdag
    bench/viewer/measure.py flight FILE.vdag --seconds 600

- views: bytes, tiles, seconds and ray steps of each camera, in a separate browser; then `session`
- session: the same figures for all cameras in one page, one after the other
- pictures: differences from the pictures of `voxdag render`
- frames: CPU time of a frame, also for another version of the viewer (WEB is its server/web folder)
- first: the times of the first picture
- flight: memory during a flight through the cameras, sampled every ten seconds

--cameras takes a file whose lines have a name and the camera options of `voxdag render`, such as
sponza.txt in this folder. Without it, the script uses named views. Bytes, tiles and steps
do not depend on the load of the machine; the other figures do, so the load is printed. Needs
Playwright, numpy and Pillow.
"""

import argparse
import contextlib
import json
import os
import re
import statistics
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace

import numpy as np

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent.parent.parent / "tests" / "browser"))

from figures import compared, cpu_s, descendants, describe, mapped, places_of, resident, row, sums  # noqa: E402
from in_page import (  # noqa: E402
    FIRST,
    FLIGHT,
    FRAMES,
    HITS,
    IN_LARGE_PARTS,
    KEEP_ENTRIES,
    LIGHT_STEPS,
    REQUESTS,
    UNTIL_COMPLETE,
)
from programs import DagFile, Server, Voxdag, free_port  # noqa: E402
from visitor import Visitor  # noqa: E402

OPTIONS = [
    "--no-sandbox",
    "--disable-gpu-watchdog",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
WINDOW = (320, 50)  # the window's width and height minus the canvas's
NAMED_VIEWS = ("iso", "auto", "front", "top")
STEP_MS = 600_000
MIB = 1 << 20


class Measurement:
    def __init__(self, arguments, play, folder):
        self.arguments, self.play, self.folder = arguments, play, folder
        self.dag = Path(arguments.file)
        self.voxdag = Voxdag(Path(arguments.voxdag).resolve(), folder)
        self.width, self.height = map(int, arguments.size.split("x"))
        if arguments.cameras:
            lines = Path(arguments.cameras).read_text(encoding="utf-8").splitlines()
            self.cameras = dict(line.split(" ", 1) for line in lines if line.strip())
        else:
            self.cameras = {name: self.voxdag.named_view(self.dag, name) for name in NAMED_VIEWS}
        if arguments.only:
            self.cameras = {name: self.cameras[name] for name in arguments.only.split(",")}

    def server(self):
        return Server(
            [self.voxdag.program, "view", self.dag, "--port", free_port()], self.folder, "view"
        )

    @contextlib.contextmanager
    def visitor(self, width=None, height=None):
        """A separate browser with a canvas of this size."""
        browser = self.play.chromium.launch(executable_path="/usr/bin/chromium", args=OPTIONS)
        visitor = Visitor(
            browser,
            self.folder,
            "measured",
            (width or self.width) + WINDOW[0],
            (height or self.height) + WINDOW[1],
            device_scale_factor=1,
        )
        visitor.timeout_ms = STEP_MS
        visitor.context.set_default_timeout(STEP_MS)
        visitor.context.add_init_script(KEEP_ENTRIES)
        yield visitor
        visitor.leave()
        browser.close()

    def address(self, url, camera):
        _, eye, target, fov = re.split(r" ?--\w+ ", camera)
        budget = f"?budget={self.arguments.budget}" if self.arguments.budget else ""
        return f"{url}/{budget}#camera={eye}&target={target}&fov={fov}"

    def say(self, **values):
        print(json.dumps({**values, "load": round(os.getloadavg()[0], 1)}), flush=True)

    def views(self):
        files = DagFile(SimpleNamespace(read_bytes=lambda: mapped(self.dag)))
        asked = {}
        for name, camera in self.cameras.items():
            with self.server() as server, self.visitor() as visitor:
                before_s = cpu_s(server.process.pid)
                visitor.open(self.address(server.url, camera))
                visitor.page.evaluate(IN_LARGE_PARTS)
                done = visitor.page.evaluate(UNTIL_COMPLETE, [None, True])
                spent_s = cpu_s(server.process.pid) - before_s
                asked[name], bytes_of = sums(visitor.page.evaluate(REQUESTS, 0))
                hits = visitor.page.evaluate(HITS)
                self.say(
                    view=name,
                    **row(done),
                    server_cpu_s=spent_s,
                    asked=len(asked[name]),
                    bytes=bytes_of,
                    widest=round(hits["widest"], 3),
                    hits=round(hits["hits"], 3),
                    **places_of(files, hits["places"]),
                    steps=describe(hits["steps"]),
                )
                if self.arguments.light:
                    light = visitor.page.evaluate(LIGHT_STEPS)
                    self.say(
                        view=name,
                        sun=describe(light["sun"]),
                        sky=describe(light["sky"]),
                        pass_ms=light["passMs"],
                    )
        counts = {}
        for tiles in asked.values():
            for tile in tiles:
                counts[tile] = counts.get(tile, 0) + 1
        self.say(
            tiles_of_all=len(counts),
            tiles_in_views={n: sum(c == n for c in counts.values()) for n in set(counts.values())},
            shared={f"{a} {b}": len(asked[a] & asked[b]) for a in asked for b in asked if a < b},
        )
        self.session(asked)

    def session(self, asked):
        """Measures all cameras in one page, one after the other."""
        with self.server() as server, self.visitor() as visitor:
            before_s, seen, evicted = cpu_s(server.process.pid), 0, 0
            for i, (name, camera) in enumerate(self.cameras.items()):
                if i == 0:
                    visitor.open(self.address(server.url, camera))
                visitor.page.evaluate(IN_LARGE_PARTS)
                done = visitor.page.evaluate(UNTIL_COMPLETE, [None if i == 0 else camera, True])
                requests = visitor.page.evaluate(REQUESTS, 0)
                tiles, bytes_of = sums(requests[seen:])
                seen = len(requests)
                self.say(
                    session=name,
                    **row(done),
                    evicted_here=done["evicted"] - evicted,
                    asked=len(tiles),
                    bytes=bytes_of,
                    server_cpu_s=cpu_s(server.process.pid) - before_s,
                    not_asked_in_its_own=len(tiles - asked.get(name, set())),
                )
                evicted = done["evicted"]
            tiles, bytes_of = sums(requests)
            self.say(session="all", asked=len(tiles), bytes=bytes_of)

    def pictures(self):
        from PIL import Image

        out = Path(self.arguments.output)
        out.mkdir(parents=True, exist_ok=True)
        for name, camera in self.cameras.items():
            with self.server() as server, self.visitor() as visitor:
                visitor.open(self.address(server.url, camera))
                visitor.page.evaluate(UNTIL_COMPLETE, [None, True])
                width, height, pixels = visitor.canvas()
                depths, _ = visitor.capture(width, height)
                light = visitor.page.evaluate("voxdagViewer.renderer.light")
            ours = np.frombuffer(pixels, np.uint8).reshape(height, width, 4)[:, :, :3]
            reference, picture = (
                np.array(self.voxdag.render(self.dag, camera, width, height)),
                out / f"{name}_render.png",
            )
            self.voxdag.run(
                "render",
                self.dag,
                "-o",
                picture,
                *camera.split(),
                "--force",
                "--size",
                f"{width}x{height}",
                "--samples",
                4,
            )
            its = np.asarray(Image.open(picture).convert("RGB"))
            Image.fromarray(ours).save(out / f"{name}_viewer.png")
            self.say(
                view=name,
                **compared(
                    np.array(depths).reshape(height, width),
                    reference.reshape(height, width),
                    ours.astype(float),
                    its.astype(float),
                ),
                light={key: light[key] for key in ("sun", "exposure", "skyReach", "hazeStart")},
            )

    def frames(self):
        """Measures both versions of the viewer alternately, with the tiles of one server.
        The cost of a frame is the CPU time of the browser's graphics process, which does not depend
        on the load."""
        own = Path(__file__).resolve().parent.parent.parent / "server" / "web"
        with contextlib.ExitStack() as stack:
            server, visitors, known = stack.enter_context(self.server()), {}, set()
            for version, folder in (("this", own), ("other", Path(self.arguments.other))):
                visitor = stack.enter_context(self.visitor())
                url = stack.enter_context(served(folder, server.url))
                visitor.open(self.address(url, next(iter(self.cameras.values()))))
                (pid,) = set(descendants("gpu-process")) - known
                known.add(pid)
                visitors[version] = visitor, pid
            for name, camera in self.cameras.items():
                costs = {version: [] for version in visitors}
                for visitor, _ in visitors.values():
                    visitor.show(camera, complete=False)
                    visitor.wait_until("voxdagViewer.renderer.isComplete")
                for _ in range(self.arguments.rounds):
                    for version, (visitor, pid) in visitors.items():
                        before_s = cpu_s(pid)
                        measured = visitor.page.evaluate(
                            FRAMES, [self.arguments.frames, self.width, self.height]
                        )
                        costs[version].append((cpu_s(pid) - before_s) / self.arguments.frames)
                        self.say(
                            version=version,
                            view=name,
                            cpu_s_per_frame=round(costs[version][-1], 3),
                            **measured,
                        )
                ratios = [b / a for a, b in zip(costs["this"], costs["other"])]
                self.say(
                    view=name,
                    **{
                        version: round(statistics.median(each), 3)
                        for version, each in costs.items()
                    },
                    times_as_fast=round(statistics.median(ratios), 2),
                    ratios=[round(r, 2) for r in ratios],
                )

    def first(self):
        camera = next(iter(self.cameras.values()))
        found = []
        with self.server() as server:
            for _ in range(self.arguments.rounds):
                with self.visitor() as visitor:
                    visitor.page.goto(self.address(server.url, camera), wait_until="commit")
                    measured = None
                    while measured is None:
                        visitor.page.wait_for_timeout(50)
                        measured = visitor.page.evaluate(FIRST)
                    requests = [
                        each
                        for each in visitor.page.evaluate(REQUESTS, 0)
                        if each[1] < measured["first"]
                    ]
                measured["bytes"] = sums(requests)[1]
                page = [each for each in requests if "/api/" not in each[0]]
                measured["page_done"] = max(each[2] for each in page)
                measured["manifest_done"] = max(
                    each[2] for each in requests if each[0].endswith("/tiles")
                )
                found.append(measured)
                self.say(**measured)
        self.say(
            medians={
                key: round(statistics.median(each[key] for each in found))
                for key in ("page_done", "manifest_done", "begin", "compile", "first")
            }
        )

    def flight(self):
        rows, seconds = [], self.arguments.seconds
        with self.server() as server, self.visitor() as visitor:
            cameras = list(self.cameras.values())
            visitor.open(self.address(server.url, cameras[0]))
            session = visitor.context.new_cdp_session(visitor.page)
            visitor.page.evaluate(FLIGHT, [cameras, self.arguments.leg])
            begin = time.monotonic()
            while time.monotonic() - begin < seconds:
                visitor.page.wait_for_timeout(10_000)
                session.send("HeapProfiler.collectGarbage")
                state = visitor.statistics()
                requests = visitor.page.evaluate(
                    "[itsFlight.frames, performance.getEntriesByType('resource').length]"
                )
                rows.append(
                    {
                        "s": round(time.monotonic() - begin),
                        "heap": session.send("Runtime.getHeapUsage")["usedSize"] / MIB,
                        "gpu_process": sum(resident(pid) for pid in descendants("gpu-process")),
                        "page_process": sum(resident(pid) for pid in descendants("renderer")),
                        "server": resident(server.process.pid),
                        "server_own": resident(server.process.pid, "RssAnon"),
                        "pool": state["poolBytes"] / MIB,
                        "tile_bytes": state["tileBytes"] / MIB,
                        "tiles": state["tiles"],
                        "requested": state["requested"],
                        "evicted": state["evicted"],
                        "fetched": state["fetchedBytes"] / MIB,
                        "frames": requests[0],
                    }
                )
                self.say(**{key: round(value, 1) for key, value in rows[-1].items()})
            visitor.page.evaluate("itsFlight.stopped = true")
        for minute in range(int(seconds // 60)):
            of = [each for each in rows if 60 * minute < each["s"] <= 60 * (minute + 1)]
            self.say(
                minute=minute + 1,
                **{
                    key: [
                        round(f([each[key] for each in of]), 1)
                        for f in (min, statistics.median, max)
                    ]
                    for key in of[0]
                    if key != "s"
                }
                if of
                else {},
            )


@contextlib.contextmanager
def served(folder, server_url):
    """Serves the viewer's files from `folder`, and forwards all other requests to `server_url`."""
    kinds = {
        ".js": "text/javascript",
        ".css": "text/css",
        ".svg": "image/svg+xml",
        ".html": "text/html",
    }

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self):
            path = self.path.split("?")[0]
            file = folder / ("viewer.html" if path == "/" else path[1:])
            if file.is_file():
                status, body, kind = 200, file.read_bytes(), kinds.get(file.suffix, "text/plain")
            else:
                try:
                    with urllib.request.urlopen(server_url + self.path) as answer:
                        status, body, kind = 200, answer.read(), answer.headers["Content-Type"]
                except urllib.error.HTTPError as error:
                    status, body, kind = error.code, error.read(), "application/json"
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    web = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=web.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{web.server_port}"
    web.shutdown()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "what", choices=["views", "session", "pictures", "frames", "first", "flight"]
    )
    parser.add_argument("file")
    parser.add_argument("--voxdag", default="build/quick/voxdag", help="the program")
    parser.add_argument("--cameras", help="a file of names and cameras")
    parser.add_argument("--only", help="some of the names, with commas")
    parser.add_argument("--size", default="1920x1080", help="of the canvas")
    parser.add_argument("--budget", type=int, help="of the tiles, in MiB")
    parser.add_argument(
        "--light", action="store_true", help="views: steps of the rays to the sun and the sky, too"
    )
    parser.add_argument("--other", help="frames: the folder server/web of another version")
    parser.add_argument("--rounds", type=int, default=3, help="frames, first: how often")
    parser.add_argument("--frames", type=int, default=8, help="frames: of one turn")
    parser.add_argument("--seconds", type=float, default=600, help="flight: how long")
    parser.add_argument(
        "--leg", type=float, default=12, help="flight: seconds from one camera to the next"
    )
    parser.add_argument("--output", default="pictures", help="pictures: the folder")
    arguments = parser.parse_args()
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory(prefix="measure-viewer-") as folder, sync_playwright() as play:
        measurement = Measurement(arguments, play, Path(folder))
        if arguments.what == "session":
            measurement.session({})
        else:
            getattr(measurement, arguments.what)()


if __name__ == "__main__":
    main()
