"""Generates a Python client from the OpenAPI document, and runs a job with it.

    openapi_client.py VOXDAG

Needs openapi-python-client (pip install openapi-python-client). Without it, the script exits with
77, which ctest counts as skipped.
"""

import importlib.util
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "browser"))

from programs import Server  # noqa: E402

SKIPPED = 77


def generate(server, folder):
    document = folder / "openapi.json"
    document.write_bytes(server.get("/openapi.json"))
    # Without this setting, the generator would run ruff to format its output.
    (folder / "config.yml").write_text("post_hooks: []\n", encoding="utf-8")
    done = subprocess.run(
        [
            *(sys.executable, "-m", "openapi_python_client", "generate"),
            *("--path", document, "--config", folder / "config.yml"),
            *("--meta", "none", "--output-path", folder / "generated_client"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    # The generator does not know the type of the picture, so it leaves out this request, but no
    # other.
    warnings = [line for line in done.stdout.splitlines() if "WARNING" in line]
    assert all("preview.png" in line for line in warnings), done.stdout
    sys.path.insert(0, str(folder))


def run_job(url):
    """Submits a job, follows it and reads the result, as docs/api.md describes."""
    from generated_client import Client
    from generated_client.api.jobs import get_job, list_jobs, post_job
    from generated_client.api.results import get_report
    from generated_client.models import JobRequest

    client = Client(base_url=url)
    request = {"scene": "sponge.glb", "resolution": 64, "labels": ["generated"]}
    job = post_job.sync(client=client, body=JobRequest.from_dict(request))
    deadline = time.monotonic() + 120
    while job.state not in ("succeeded", "failed") and time.monotonic() < deadline:
        time.sleep(0.2)
        job = get_job.sync(job.id, client=client)
    assert job.state == "succeeded", job
    assert (
        job.result.voxels > 0 and get_report.sync_detailed(job.id, client=client).status_code == 200
    )
    assert [each.id for each in list_jobs.sync(client=client, label="generated").jobs] == [job.id]


def main():
    if importlib.util.find_spec("openapi_python_client") is None:
        print("skipped: no openapi-python-client here (pip install openapi-python-client)")
        return SKIPPED
    voxdag = sys.argv[1]
    with tempfile.TemporaryDirectory(prefix="openapi-client-") as name:
        folder = Path(name)
        scene = folder / "sponge.glb"
        subprocess.run(
            [voxdag, "generate", "menger", scene, "--level", "1"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        command = [voxdag, "serve", "--port", 0, "--data", folder / "data"]
        with Server(command, folder, "server") as server:
            server.send("PUT", "/api/v1/scenes/sponge.glb", scene.read_bytes())
            generate(server, folder)
            run_job(server.url)
    return 0


if __name__ == "__main__":
    sys.exit(main())
