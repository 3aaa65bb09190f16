"""Running jobs: their partial result, and how they end."""

import json
import math
import os
import signal
import time
import urllib.error
from pathlib import Path

WAIT_S = 60
MAX_PAUSE_S = 0.5  # after a longer pause, the job could be past the awaited state or have ended
SCENE = "running.glb"
RESOLUTION, SUBVOLUME = 4096, 512
# The partial result is drawn in cells of this level.
CELL_LEVEL = int(math.log2(RESOLUTION / (SUBVOLUME // 4)))
PICTURE = (96, 54)

# Returns numbers of pixels of the wireframe over the picture: all lines, and lines of active
# subvolumes.
WIRES = """() => {
  const canvas = document.querySelector("canvas.wires");
  const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  const counts = {all: 0, working: 0};
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] < 64) continue;
    counts.all++;
    counts.working += data[i] > data[i + 2] + 60;
  }
  return counts;
}"""


class Job:
    """A job of the service that the test can hold at any time."""

    def __init__(self, server, resolution, **options):
        self.server = server
        self.id = server.post(
            "/api/v1/jobs", {"scene": SCENE, "resolution": resolution, "options": options}
        )["id"]
        self.path = f"/api/v1/jobs/{self.id}"
        self.page = f"{server.url}/viewer.html?job={self.id}"

    def state(self):
        return json.loads(self.server.get(self.path))["state"]

    def subvolumes(self):
        return self.known("subvolumes")

    def known(self, what):
        """Returns the answer to a request for `what`. Returns {} before the subvolumes are planned,
        and if the service serves too many jobs already."""
        try:
            return json.loads(self.server.get(f"{self.path}/{what}"))
        except urllib.error.HTTPError as error:
            assert error.code in (404, 503), error
            return {}

    def until(self, what, condition):
        deadline = time.monotonic() + WAIT_S
        while not condition():
            assert time.monotonic() < deadline, f"job {self.id}: not within {WAIT_S} s: {what}"
            assert self.state() not in ("failed", "succeeded"), (
                f"job {self.id} ended before: {what}"
            )
            time.sleep(0.02)

    def durable(self):
        """Returns the numbers of visible and of all built subvolumes."""
        partial = self.known("partial")
        return partial.get("built", 0), partial.get("total", 0)

    def change(self, how, state):
        self.server.send("POST", f"{self.path}/{how}")
        self.until(state, lambda: self.state() == state)

    def build_until(self, built):
        """Lets the job build at least `built` subvolumes, then suspends it."""
        pause_s = 0.05
        while True:
            self.until("one is being built", lambda: self.subvolumes().get("working"))
            time.sleep(pause_s)
            self.change("suspend", "suspended")
            self.until("its process has ended", lambda: not self.processes())
            if self.subvolumes()["built"] >= built:
                return self.until("it can be seen", lambda: self.durable()[0] >= built)
            self.change("resume", "running")
            pause_s = min(1.5 * pause_s, MAX_PAUSE_S)

    def processes(self):
        """Returns the process ids of the service's child processes: the running job, if any."""
        threads = Path(f"/proc/{self.server.process.pid}/task").glob("*/children")
        return [
            int(child)
            for children in threads
            for child in children.read_text(encoding="utf-8").split()
        ]

    def hold_at_work(self):
        """Stops the job's process at a moment when it is building a subvolume."""
        while True:
            self.until("one is being built", lambda: self.subvolumes().get("working"))
            self.signal(signal.SIGSTOP)
            if self.subvolumes().get("working"):
                return
            self.signal(signal.SIGCONT)

    def signal(self, number):
        for process in self.processes():
            os.kill(process, number)


def capture(visitor):
    visitor.page.evaluate("voxdagViewer.renderer.complete()")
    return visitor.capture(*PICTURE)[0]


def hits(depths):
    return sum(math.isfinite(d) for d in depths)


def uncovered(depths, others):
    """Returns how many rays of `depths` hit a surface that the rays of `others` miss or pass."""
    return sum(math.isfinite(d) and not other < d * 1.002 for d, other in zip(depths, others))


def check_growing(visitor, server):
    """The partial result grows in view. At the end the result appears without a reload."""
    page = visitor.page
    job = Job(server, RESOLUTION, subvolume=SUBVOLUME, threads=1)
    job.build_until(4)
    built, total = job.durable()
    assert built < total / 4, f"{built} of {total} subvolumes are built already"

    visitor.open(job.page)
    visitor.wait_until("voxdagViewer.running && Boolean(voxdagViewer.renderer.info.root)")
    visitor.wait_until("voxdagViewer.wires.counts.built > 0")
    page.evaluate("window.isSamePage = true")
    page.keyboard.press("ArrowLeft")
    early, camera = capture(visitor), visitor.camera()
    counts = page.evaluate("voxdagViewer.wires.counts")
    assert counts["built"] + counts["waiting"] == total and counts["working"] == 0, counts
    wires = page.evaluate(WIRES)
    assert wires["all"] > 200 and wires["working"] == 0, wires
    assert hits(early) > 0, "nothing of what is built is seen"

    job.change("resume", "running")
    job.hold_at_work()
    try:
        visitor.wait_until("voxdagViewer.wires.counts.working === 1")
        page.evaluate(
            "new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)))"
        )
        assert page.evaluate(WIRES)["working"] > 50, "what is being built is not marked"
        visitor.picture("running")
    finally:
        job.signal(signal.SIGCONT)
    job.build_until(built + total / 4)
    visitor.wait_until("(built) => voxdagViewer.renderer.info.built >= built", job.durable()[0])
    late = capture(visitor)
    assert visitor.camera() == camera, "what is built moves the camera"
    assert hits(late) >= hits(early) and uncovered(late, early) > 0, "nothing has grown"
    assert uncovered(early, late) <= 0.01 * hits(early), "something that was built is gone"
    page.get_by_role("button", name="Subvolumes").click()
    page.locator("canvas.wires").wait_for(state="hidden")
    page.keyboard.press("o")
    assert page.locator("#panel").is_hidden(), "the panel is open"

    server.send("POST", f"{job.path}/resume")
    visitor.wait_until("Boolean(window.voxdagViewer) && !voxdagViewer.running")
    assert page.evaluate("isSamePage"), "the page was loaded again"
    assert page.locator(".banner, canvas.wires").count() == 0
    assert page.locator(".mark").count() == 2, "the marks of the running job are left"
    assert page.locator("#panel").is_hidden(), "the panel was opened again"
    away = math.dist(camera["eye"], visitor.camera()["eye"])
    assert away < 0.01, f"the camera is {away} voxels away"
    page.evaluate("(level) => voxdagViewer.viewer.setOptions({level})", CELL_LEVEL)
    result = capture(visitor)
    assert uncovered(late, result) <= 0.01 * hits(late), (
        "something was shown that is not in the result"
    )


def check_ends(visitor, server):
    """Jobs that are canceled and deleted while they are viewed, and a waiting job."""
    page = visitor.page
    job = Job(server, 2 * RESOLUTION, subvolume=SUBVOLUME, threads=1)
    job.until("its plan can be read", lambda: job.durable()[1] > 0)
    job.signal(signal.SIGSTOP)
    try:
        queued = Job(server, 64)
        visitor.open(queued.page, wait=False)
        page.get_by_role("heading", name="This job is queued.").wait_for()
        queued.change("cancel", "canceled")
        page.get_by_text("It has no result.").wait_for()
        visitor.open(job.page)
        visitor.wait_until("voxdagViewer.running && voxdagViewer.wires.counts.waiting > 0")
        server.send("POST", f"{job.path}/cancel")
    finally:
        job.signal(signal.SIGCONT)
    page.get_by_text("The picture shows its built part.").wait_for()
    assert page.evaluate(WIRES)["all"] > 200, "the wireframe of a canceled job is gone"
    job.until("it is canceled", lambda: job.state() == "canceled")
    server.send("DELETE", job.path)
    page.get_by_text("no such job").wait_for()
    for part in ("#scene", "#tools", "#panel", ".banner", "canvas.wires"):
        assert page.locator(part).is_hidden(), f"{part} is shown next to the message"


def check_color_stage(visitor, server):
    """While colors are computed, the viewer shows the complete DAG, and the job's page how many
    regions are ready."""
    job = Job(server, RESOLUTION, threads=1, color=True)

    def is_coloring():
        progress = json.loads(server.get(job.path)).get("progress") or {}
        return (
            progress.get("stage") == "color"
            and progress.get("total")
            and job.known("partial/tiles").get("merged")
        )

    job.until("its colors are computed", is_coloring)
    job.signal(signal.SIGSTOP)
    try:
        visitor.open(job.page)
        visitor.wait_until("voxdagViewer.running && Boolean(voxdagViewer.renderer.info.root)")
        assert hits(capture(visitor)) > 0, "the DAG is not shown while colors are computed"
        visitor.open(f"{server.url}/#/jobs/{job.id}", wait=False)
        visitor.page.get_by_text("% of the regions are ready").wait_for()
        visitor.open("about:blank", wait=False)
        server.send("POST", f"{job.path}/cancel")
    finally:
        job.signal(signal.SIGCONT)
    job.until("it is canceled", lambda: job.state() == "canceled")


def check_running_jobs(visitor, server, scene):
    server.send("PUT", f"/api/v1/scenes/{SCENE}", scene.read_bytes())
    # Before the plan, after the end and after a deletion, the service answers requests with 404 or
    # 409.
    with visitor.expecting("status of 40[49]"):
        check_ends(visitor, server)
        check_growing(visitor, server)
        check_color_stage(visitor, server)
