"""`voxdag serve` whose jobs build on a Slurm cluster."""

import json
import subprocess
import time
import urllib.request

from slurm_cluster import free_ports


class Service:
    """`voxdag serve` whose jobs build on the cluster."""

    def __init__(self, voxdag, folder, scene, environment):
        self.voxdag = voxdag
        self.environment = environment
        folder.mkdir()
        self.settings = folder / "server.json"
        self.port = free_ports(1)[0]
        self.settings.write_text(
            json.dumps(
                {
                    "port": self.port,
                    "data_folder": str(folder / "data"),
                    "scene_roots": [str(scene.parent)],
                    "cluster": {"engine": "slurm", "tasks": 8, "grace_s": 2},
                }
            )
        )
        self.scene = scene

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(timeout=30)

    def start(self):
        self.process = subprocess.Popen(
            [self.voxdag, "serve", "--config", self.settings],
            stderr=subprocess.DEVNULL,
            env=self.environment,
        )
        for _ in range(200):
            try:
                self.get("/readyz")
                return
            except OSError:
                time.sleep(0.05)
        raise RuntimeError("the service does not start")

    def kill(self):
        self.process.kill()
        self.process.wait()

    def get(self, path, body=None, method=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.port}{path}",
            data,
            method=method,
            headers={"Content-Type": "application/json"},
        )
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.read()

    def submit(self, resolution):
        body = {"scene": str(self.scene), "resolution": resolution}
        return json.loads(self.get("/api/v1/jobs", body))["id"]

    def job(self, job):
        return json.loads(self.get(f"/api/v1/jobs/{job}"))

    def action(self, job, name):
        self.get(f"/api/v1/jobs/{job}/{name}", method="POST")

    def tasks(self, job):
        """Returns the running tasks by node."""
        cluster = (self.job(job)["progress"] or {}).get("cluster")
        return cluster and {n["name"]: n["running"] for n in cluster["nodes"] if n["running"]}
