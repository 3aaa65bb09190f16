"""Checks the chart of a job's rate in the dashboard."""

# True if the chart shows the rate of the present stage, and ends with the rate in the text above.
HAS_RATE_OF_TEXT = """() => {
  const text = (selector) => document.querySelector(selector)?.textContent;
  const label = document.querySelector("svg.plot:not([hidden])")?.getAttribute("aria-label");
  const [, stage, rate] = label?.match(/^Rate of (.*): latest (.* per second)$/) ?? [];
  return stage && stage === text(".stage-now") && text(".detail").includes(` ${rate}`);
}"""


def check_running(page):
    """The chart also shows the time before the page was opened, and agrees with the text."""
    page.reload()
    page.wait_for_function(HAS_RATE_OF_TEXT)


def check_stopped(page):
    """A page that is opened after the job has stopped shows the chart."""
    page.reload()
    page.locator("svg.plot").wait_for()
