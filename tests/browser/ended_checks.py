"""Jobs that ended and are retried, and files and jobs that do not exist."""

import json
import signal

from running_checks import RESOLUTION, SCENE, SUBVOLUME, Job

IS_RESULT = "Boolean(window.voxdagViewer) && !voxdagViewer.running"

# Records the times at which the page requests its job. `asked.way` decides whether such a request
# gets an answer ("answer") or fails ("lose").
ASKED = """
window.asked = {times: [], way: "answer"};
const plainFetch = window.fetch;
window.fetch = (url, options) => {
  if (/\\/jobs\\/[0-9a-f]+$/.test(url)) {
    asked.times.push(performance.now());
    if (asked.way === "lose") return Promise.reject(new TypeError("lost"));
  }
  return plainFetch(url, options);
};
"""


# Simulates that the user returns to the tab. This ends a pause between two requests.
WAKE = "document.dispatchEvent(new Event('visibilitychange'))"


def heading(visitor, text):
    visitor.page.get_by_role("heading", name=text).wait_for()


def expect_no_cubes(visitor):
    cubes = visitor.page.locator(".cubes-view")
    assert cubes.count() == 1 and cubes.is_hidden(), (
        "a job that has ended says when its subvolumes will be shown"
    )


def check_retry_of_canceled(visitor, server):
    """A page of a canceled job polls at growing intervals until it can draw."""
    page = visitor.page
    page.add_init_script(ASKED)
    job = Job(server, 2 * RESOLUTION, subvolume=SUBVOLUME, threads=1)
    job.until("its plan can be read", lambda: job.durable()[1] > 0)
    server.send("POST", f"{job.path}/cancel")
    job.until("it is canceled", lambda: job.state() == "canceled")

    visitor.open(job.page, wait=False)
    heading(visitor, "This job is canceled.")
    page.get_by_text("It has no result.").wait_for()
    page.evaluate("window.isSamePage = true")
    link = page.get_by_role("link", name="The job's page")
    link.focus()
    visitor.wait_until("asked.times.length >= 3")
    times = page.evaluate("asked.times.slice(0, 3)")
    assert times[1] - times[0] < times[2] - times[1], f"the pauses do not grow: {times}"
    assert link.evaluate("(link) => link === document.activeElement"), (
        "asking again takes the focus away"
    )
    page.evaluate(f"asked.way = 'lose', {WAKE}")
    heading(visitor, "This job was canceled.")
    page.get_by_text("The service does not answer. Trying again.").wait_for()
    server.send("POST", f"{job.path}/retry")
    job.until("its new plan can be read", lambda: job.durable()[1] > 0)
    job.signal(signal.SIGSTOP)
    assert job.known("partial/tiles").get("camera"), "a job at work cannot be drawn"
    page.evaluate(f"asked.way = 'answer', {WAKE}")
    visitor.wait_until("Boolean(window.voxdagViewer?.running)")
    job.signal(signal.SIGCONT)
    visitor.wait_until(IS_RESULT)
    assert page.evaluate("window.isSamePage === true"), "the page was loaded again"


def check_never_planned(visitor, server):
    """A job canceled before its plan has no cubes. It is deleted while its page is open."""
    page = visitor.page
    holder = Job(server, RESOLUTION, subvolume=SUBVOLUME, threads=1)
    holder.hold_at_work()
    job = Job(server, 64)
    server.send("POST", f"{job.path}/cancel")
    visitor.open(job.page, wait=False)
    heading(visitor, "This job is canceled.")
    expect_no_cubes(visitor)
    server.send("POST", f"{job.path}/retry")
    page.evaluate(WAKE)
    heading(visitor, "This job is queued.")
    page.get_by_text("Shown when the subvolumes are planned.").wait_for()
    server.send("POST", f"{job.path}/cancel")
    heading(visitor, "This job is canceled.")
    expect_no_cubes(visitor)
    server.send("DELETE", job.path)
    page.evaluate(WAKE)
    expect_no_such_job(visitor)
    server.send("POST", f"{holder.path}/cancel")  # before it can succeed
    holder.signal(signal.SIGCONT)


def expect_no_such_job(visitor):
    page = visitor.page
    page.get_by_text("no such job").wait_for()
    page.get_by_text("not_found · HTTP 404").wait_for()
    assert page.get_by_role("button", name="Try again").count() == 0, (
        "a job that is not there is offered again"
    )


def check_no_such_job(visitor, url):
    for job in ("zz", "", "a" * 33, "ABC", "1/../2"):
        asked = []
        visitor.page.on("request", record := lambda request, asked=asked: asked.append(request.url))
        visitor.open(f"{url}/viewer.html?job={job}", wait=False)
        expect_no_such_job(visitor)
        visitor.page.remove_listener("request", record)
        asked = [address for address in asked if "/api/" in address]
        assert not asked, f"?job={job} asks for {asked}"


def expect_no_file(visitor):
    heading(visitor, "The file does not exist.")
    visitor.page.get_by_text("not_found · HTTP 404").wait_for()
    for part in ("#scene", "#tools", "#panel"):
        assert visitor.page.locator(part).is_hidden(), f"{part} is shown next to the message"


def check_removed_file(visitor, server, built):
    """The page reports a missing file until it exists again."""
    away = built.with_suffix(".away")
    with visitor.expecting("status of 404"):
        built.rename(away)
        visitor.open(server.url, wait=False)
        expect_no_file(visitor)
        away.rename(built)
        visitor.page.get_by_role("button", name="Try again").click()
        visitor.wait_until("Boolean(window.voxdagViewer)")
        check_no_such_job(visitor, server.url)


def check_ended_jobs(visitor, server, scene):
    server.send("PUT", f"/api/v1/scenes/{SCENE}", scene.read_bytes())
    with visitor.expecting("status of 40[49]"):
        check_retry_of_canceled(visitor, server)
        check_never_planned(visitor, server)
        check_no_such_job(visitor, server.url)
        visitor.open(f"{server.url}/viewer.html?job=1234", wait=False)
        expect_no_such_job(visitor)
        visitor.open(f"{server.url}/viewer.html", wait=False)
        expect_no_file(visitor)
    jobs = json.loads(server.get("/api/v1/jobs"))["jobs"]
    assert all(job["state"] in ("succeeded", "failed", "canceled", "canceling") for job in jobs), (
        jobs
    )
