"""Jobs that continue after a restart, after a failure, with another scene, among many."""

import json
import shutil
import signal
import sqlite3
from contextlib import closing

from running_checks import RESOLUTION, SCENE, SUBVOLUME, Job, capture, hits

MANY = 16  # running jobs whose partial results the service keeps for viewers
BANNER = "document.querySelector('.banner-text')?.textContent ?? ''"
RUNS = "Boolean(window.voxdagViewer?.running) && voxdagViewer.renderer.isReady"


def says(visitor, text):
    visitor.wait_until(f"(text) => ({BANNER}).includes(text)", text)


def hold(job):
    """Stops the job's process as soon as it exists."""
    job.until("its process runs", job.processes)
    job.signal(signal.SIGSTOP)


def expect_same_view(visitor, camera):
    assert visitor.page.evaluate("window.isSamePage === true"), "the page was loaded again"
    away = max(abs(a - b) for a, b in zip(camera["eye"], visitor.camera()["eye"]))
    assert away < 0.01, f"the camera is {away} voxels away"


def check_restart(visitor, server, job):
    """The picture remains while the service is down. Afterwards the viewer continues."""
    visitor.open(job.page)
    visitor.wait_until("voxdagViewer.running && Boolean(voxdagViewer.renderer.info.root)")
    visitor.page.evaluate("window.isSamePage = true")
    visitor.page.keyboard.press("ArrowLeft")
    before, camera = hits(capture(visitor)), visitor.camera()
    digest = visitor.page.evaluate("voxdagViewer.renderer.info.digest")
    assert before > 0, "nothing of what is built is seen"
    job.change("resume", "running")
    server.kill()
    says(visitor, "The service does not answer.")
    assert hits(capture(visitor)) >= before, "what was built is gone from the picture"
    server.start()
    hold(job)
    visitor.wait_until(
        f"(digest) => {RUNS} && Boolean(voxdagViewer.renderer.info.root) &&"
        " voxdagViewer.renderer.info.digest !== digest",
        digest,
    )
    says(visitor, "are built")
    assert hits(capture(visitor)) >= before, "what was built before the restart is not shown"
    expect_same_view(visitor, camera)
    return camera


def check_retries(visitor, server, job, camera, other_scene):
    """A job fails, is retried, is canceled, and is retried with another scene."""
    job.signal(signal.SIGKILL)
    says(visitor, "is failed and has no result. The picture shows its built part.")
    assert hits(capture(visitor)) > 0, "what was built of a failed job is gone"
    server.send("POST", f"{job.path}/retry")
    hold(job)
    says(visitor, "are built")
    visitor.wait_until(f"{RUNS} && Boolean(voxdagViewer.renderer.info.root)")
    assert hits(capture(visitor)) > 0, "what was built before the failure is not shown"
    expect_same_view(visitor, camera)

    server.send("POST", f"{job.path}/cancel")
    job.signal(signal.SIGCONT)
    says(visitor, "is canceled and has no result.")
    server.send("PUT", f"/api/v1/scenes/{SCENE}", other_scene.read_bytes())
    server.send("POST", f"{job.path}/retry")
    visitor.wait_until("Boolean(window.voxdagViewer) && !voxdagViewer.running")
    result = json.loads(server.get(job.path))["result"]
    assert visitor.page.evaluate("voxdagViewer.renderer.info.voxels") == str(result["voxels"]), (
        "it is not the last result"
    )
    assert visitor.page.evaluate("window.isSamePage === true"), "the page was loaded again"


def has_stored_plan(store):
    """Returns whether the job store has its subvolumes. Asking the service would view the job."""
    try:
        with closing(sqlite3.connect(f"file:{store}?mode=ro", uri=True)) as database:
            return database.execute("SELECT count(*) FROM subvolume").fetchone()[0] > 0
    except sqlite3.OperationalError:  # no file or no table yet
        return False


def check_many(visitor, server, data):
    """Beyond the limit of viewed jobs, one more is described in text until another one closes."""
    job = Job(server, 4 * RESOLUTION, subvolume=SUBVOLUME, threads=1)
    store = data / "jobs" / job.id / "work" / "job.db"
    job.until("its plan is stored", lambda: has_stored_plan(store))
    job.signal(signal.SIGSTOP)
    try:
        others = [Job(server, 4 * RESOLUTION) for _ in range(MANY)]
        for other in others:
            # Copies the folder of the first job. So this waiting job looks as if it had run before.
            shutil.copytree(data / "jobs" / job.id, data / "jobs" / other.id)
        # The service refuses one of them until it forgets the job that was viewed before.
        job.until(
            "the waiting jobs are viewed", lambda: all(other.durable()[1] > 0 for other in others)
        )
        visitor.open(job.page, wait=False)
        visitor.page.get_by_role("heading", name="This job is running.").wait_for()
        assert not visitor.page.evaluate("Boolean(window.voxdagViewer)"), (
            "more jobs are drawn than the service remembers"
        )
        server.send("POST", f"{others[0].path}/cancel")
        server.send("DELETE", others[0].path)
        visitor.wait_until(RUNS)
        says(visitor, "are built")
        for other in others[1:]:
            server.send("POST", f"{other.path}/cancel")
        server.send("POST", f"{job.path}/cancel")
    finally:
        job.signal(signal.SIGCONT)
    says(visitor, "is canceled and has no result.")


def check_watched_jobs(visitor, server, data, scene, other_scene):
    """Runs all checks of this module. `data` is the service's data folder. After a restart, the
    service listens on the same port."""
    server.send("PUT", f"/api/v1/scenes/{SCENE}", scene.read_bytes())
    job = Job(server, RESOLUTION, subvolume=SUBVOLUME, threads=1)
    job.build_until(4)
    with visitor.expecting(r"status of (404|409|410|503)|net::ERR_"):
        camera = check_restart(visitor, server, job)
        check_retries(visitor, server, job, camera, other_scene)
        check_many(visitor, server, data)
