#!/usr/bin/env python3
"""Cluster builds under a real Slurm: usage cluster_test.py VOXDAG [unittest arguments].

Tests that wait until Slurm notices a lost node, or that build long enough for many kills, run only
with VOXDAG_LONG=1 in the environment (tools/test-long cluster).

Exits with 77, which ctest reports as skipped, if Slurm is not installed (tools/packages cluster).
"""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from cutout_scene import write_cutouts
from slurm_cluster import SlurmCluster, missing_programs, running_tasks
from voxdag_service import Service

VOXDAG = ""
SKIPPED = 77
slow = unittest.skipUnless(os.environ.get("VOXDAG_LONG"), "in tools/test-long cluster")


class ClusterTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # The folder is in /tmp, because the paths of Slurm's sockets must be short.
        cls.folder = Path(tempfile.mkdtemp(prefix="vdslurm-", dir="/tmp"))
        # Sets the working directory, because a daemon that crashes writes its core dump there.
        os.chdir(cls.folder)
        cls.scene = cls.folder / "city.glb"
        subprocess.run([VOXDAG, "generate", "city", cls.scene, "--triangles", "60000"], check=True,
                       capture_output=True)
        cls.cluster = SlurmCluster(cls.folder / "slurm")
        cls.cluster.__enter__()
        cls.expected = {}

    @classmethod
    def tearDownClass(cls):
        cls.cluster.__exit__()
        shutil.rmtree(cls.folder)

    def setUp(self):
        self.output = self.folder / f"{self.id().split('.')[-1]}.vdag"
        self.work = Path(f"{self.output}.work")
        self.build = None

    def tearDown(self):
        if self.build:
            self.build.kill()
            self.build.communicate()
        subprocess.run(["scancel", "--user", str(os.getuid())], env=self.cluster.environment,
                       check=False, capture_output=True)
        self.cluster.resume_nodes()
        if self.work.exists():
            shutil.rmtree(self.work)

    def sha256(self, resolution, *options):
        """Returns the digest of the file of a build without a cluster."""
        key = (self.scene, resolution, *options)
        if key not in self.expected:
            out = self.folder / "local.vdag"
            done = subprocess.run([VOXDAG, "build", self.scene, "-r", str(resolution), "-o", out,
                                   "--json", "--force", *options], check=True, capture_output=True,
                                  text=True)
            self.expected[key] = json.loads(done.stdout)["sha256"]
            out.unlink()
        return self.expected[key]

    def start(self, resolution, tasks, *options):
        """Starts a build that wait_for() watches: a wait fails when this build ends early."""
        self.build = subprocess.Popen(
            [VOXDAG, "build", self.scene, "-r", str(resolution), "-o", self.output, "--json",
             "--cluster", "slurm", "--cluster-tasks", str(tasks), "--cluster-grace", "2", *options],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=self.cluster.environment)
        return self.build

    def end(self, build, timeout=150):
        """Waits until the build ends. Returns its output and messages. Later waits ignore it."""
        self.build = None
        try:
            return build.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            build.kill()
            _, messages = build.communicate()
            self.fail(f"the build has not ended after {timeout} s\n{messages}\n{self.state()}")

    def finish(self, build, resolution, *options):
        out, messages = self.end(build)
        self.assertEqual(build.returncode, 0, messages + self.logs())
        report = json.loads(out)
        self.assertEqual(report["sha256"], self.sha256(resolution, *options))
        self.assertFalse(self.work.exists(), f"{self.work} is left")
        return report, messages

    def logs(self):
        texts = [log.read_text(errors="replace")[-600:] for log in
                 sorted(self.work.glob("cluster/log-*"))] if self.work.exists() else []
        return "\n".join(texts[-5:])

    def state(self):
        """Returns the state of the cluster, for the message of a test whose wait timed out."""
        commands = [["sinfo", "--long", "--Node"], ["scontrol", "show", "job"]]
        states = [self.cluster.command(*command, check=False).stdout for command in commands]
        return "\n".join([*states, self.logs(), self.cluster.logs()])

    def wait_for(self, condition, what, seconds=60):
        end = time.monotonic() + seconds
        while True:
            has_ended = self.build and self.build.poll() is not None
            if found := condition():
                return found
            if has_ended or time.monotonic() > end:
                self.fail(f"no {what() if callable(what) else what} after {seconds} s\n"
                          + (f"the build has ended: {self.build.communicate()}\n"
                             if has_ended else "") + self.state())
            time.sleep(0.05)

    def tasks(self):
        """Returns the process ids of the running tasks by node."""
        return running_tasks(self.work)

    def a_task(self):
        tasks = self.wait_for(self.tasks, "running task")
        return random.choice([pid for pids in tasks.values() for pid in pids])

    def test_same_bytes_from_any_number_of_tasks(self):
        for tasks in [1, 3, 16]:
            with self.subTest(tasks=tasks):
                report, _ = self.finish(self.start(2048, tasks), 2048)
                self.assertEqual(report["cluster"]["batches"], tasks)
                self.assertEqual(report["cluster"]["failed_attempts"], 0)
                self.assertLess(report["cluster"]["rows_after"], report["cluster"]["rows_before"])

    def build_in_small_cubes(self, tasks, geometry, *options):
        build = self.start(512, tasks, "--subvolume", "64", *geometry, *options)
        report, _ = self.finish(build, 512, *geometry)
        self.assertEqual(report["cluster"]["batches"], tasks)
        return report

    def test_same_colors_from_any_number_of_tasks(self):
        self.scene = self.folder / "colored.glb"
        subprocess.run([VOXDAG, "generate", "city", self.scene, "--triangles", "4000", "--colors"],
                       check=True, capture_output=True)
        # The process that merges also bakes the colors: this process, or a job of the cluster.
        for tasks, options in [(3, []), (16, ["--cluster-merge"])]:
            report = self.build_in_small_cubes(tasks, ["--color"], *options)
            self.assertGreater(report["colors"]["cells"], 100000)

    def test_same_cutouts_from_any_number_of_tasks(self):
        self.scene = self.folder / "cutouts.gltf"
        write_cutouts(self.scene)
        self.assertNotEqual(self.sha256(512), self.sha256(512, "--cutouts", "skip"))
        # --color implies --cutouts skip.
        for tasks, geometry in [(3, ["--cutouts", "skip"]), (4, ["--color"])]:
            self.build_in_small_cubes(tasks, geometry)

    def test_same_solids_from_any_number_of_tasks(self):
        # Tasks fill by winding. The process that merges fills enclosed solids.
        for tasks, rule, options in [(1, "winding", []), (7, "winding", ["--cluster-merge"]),
                                     (5, "enclosed", [])]:
            report = self.build_in_small_cubes(tasks, ["--solid", rule], *options)
            self.assertGreater(report["solid"]["interior"], 100000)

    def test_more_batches_than_an_array_holds(self):
        report, _ = self.finish(self.start(2048, 120, "--subvolume", "128"), 2048)
        self.assertGreater(report["cluster"]["batches"], 101)

    def test_a_killed_task_is_submitted_again(self):
        build = self.start(16384, 4)
        os.kill(self.a_task(), signal.SIGKILL)
        report, messages = self.finish(build, 16384)
        self.assertEqual(report["cluster"]["failed_attempts"], 1)
        self.assertRegex(messages, r"batch \d, task \d+_\d on n\d: FAILED.*; it is submitted again")

    def test_a_batch_that_always_fails_ends_the_build(self):
        build = self.start(2048, 2, "--cluster-options", "--export=NONE,PATH=/nowhere --chdir=/",
                           "--cluster-retries", "1")
        # Another file replaces the batch's file, so every attempt reports it as damaged.
        batch = self.wait_for(lambda: sorted(self.work.glob("cluster/batch-*.vdbatch")), "batch")[0]
        batch.write_bytes(b"vdbatch3" + bytes(100))
        _, messages = self.end(build)
        self.assertNotEqual(build.returncode, 0)
        self.assertIn("it has failed 2 times", messages)
        self.assertIn(batch.name, messages)

    @slow
    def test_a_lost_node(self):
        build = self.start(16384, 8)
        node = random.choice(sorted(self.wait_for(self.tasks, "running task")))
        self.cluster.kill_machine(node)
        try:
            self.finish(build, 16384)
        finally:
            self.cluster.start_node(node)

    @slow
    def test_a_node_that_slurm_believes_lost_works_on(self):
        build = self.start(16384, 4)
        node, pids = random.choice(sorted(self.wait_for(self.tasks, "running task").items()))
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        self.cluster.kill(node)
        try:
            # Slurm starts the batch on another node. Then the stopped tasks continue.
            self.wait_for(lambda: self.cluster.command(
                "sinfo", "--noheader", f"--nodes={node}", "--format=%t").stdout.startswith("down"),
                "lost node", 90)
            for pid in pids:
                os.kill(pid, signal.SIGCONT)
            self.finish(build, 16384)
        finally:
            self.cluster.start_node(node)

    def test_slurm_restarts(self):
        build = self.start(16384, 6)
        self.wait_for(self.tasks, "running task")
        self.cluster.kill("slurmctld")
        time.sleep(8)
        self.cluster.start_controller()
        self.finish(build, 16384)
        # The restart keeps the new controller from assigning ids that the nodes still use.
        self.cluster.restart_nodes()

    def test_a_node_that_cannot_start_tasks(self):
        # Slurm holds the tasks of such a node until somebody releases or cancels them.
        spool = self.folder / "slurm" / "spool-n1"
        away = spool.rename(f"{spool}.away")
        spool.touch()
        try:
            build = self.start(16384, 8)
            self.wait_for(lambda: "held" in self.cluster.command(
                "squeue", "--noheader", "--format=%r").stdout, "task that is held")
        finally:
            spool.unlink()
            away.rename(spool)
        report, messages = self.finish(build, 16384)
        self.assertRegex(messages, r"Slurm could not start it \(launch.failed.requeued.held\)")
        self.assertGreater(report["cluster"]["failed_attempts"], 0)

    def test_the_same_command_attaches_after_ctrl_c(self):
        self.interrupt(signal.SIGINT)

    def test_the_same_command_attaches_after_a_kill(self):
        self.interrupt(signal.SIGKILL)

    def interrupt(self, how):
        build = self.start(16384, 8)
        self.wait_for(self.tasks, "running task")
        name = self.task_name()
        build.send_signal(how)
        _, messages = self.end(build, 30)
        self.assertNotEqual(build.returncode, 0)
        if how == signal.SIGINT:
            self.assertRegex(messages, "its tasks run on|last step was not completed")
        self.wait_for(lambda: list(self.work.glob("cluster/*.record-*.json")) or not self.queue(),
                      "record")
        report, _ = self.finish(self.start(16384, 8), 16384)
        self.assertLessEqual(report["cluster"]["batches"], 8)  # the rest was built before
        self.assertEqual(report["cluster"]["failed_attempts"], 0)
        # The second command took the running tasks over, so no task was submitted twice.
        self.wait_for_tasks(name, {"COMPLETED": 8})

    def queue(self):
        return self.cluster.command("squeue", "--noheader", "--array").stdout

    def task_name(self):
        """Returns the name of this build's tasks."""
        return "voxdag-" + json.loads((self.work / "cluster/cluster.json").read_text())["build"]

    def submitted(self, name):
        """Returns the number of tasks or jobs of this name that were ever submitted, by state."""
        states = self.cluster.command("squeue", "--noheader", "--array", "--states=all",
                                      f"--name={name}", "--format=%T").stdout.split()
        return {state: states.count(state) for state in set(states)}

    def wait_for_tasks(self, name, expected):
        """Waits until Slurm reports these states. It can notice an end after the build does."""
        self.wait_for(lambda: self.submitted(name) == expected,
                      lambda: f"{expected} of {self.submitted(name)}", 15)

    def test_two_builds_at_once(self):
        build = self.start(16384, 4)
        a_task = self.a_task()
        os.kill(a_task, signal.SIGSTOP)
        second = self.start(16384, 4)
        self.addCleanup(second.communicate)
        self.addCleanup(second.kill)
        self.assertIn("is in use by another build: waiting up to 30 s", second.stderr.readline())
        os.kill(a_task, signal.SIGCONT)
        second.kill()
        self.finish(build, 16384)

    def test_restart_stops_the_tasks(self):
        build = self.start(16384, 8)
        # A stopped task cannot end by itself.
        os.kill(self.a_task(), signal.SIGSTOP)
        name = self.task_name()
        build.kill()
        self.end(build)
        report, _ = self.finish(self.start(2048, 2, "--restart"), 2048)
        self.assertEqual(report["cluster"]["batches"], 2)
        self.wait_for(lambda: not self.queue() and not self.tasks(), "end of all tasks")
        self.assertIn("CANCELLED", self.submitted(name))

    def test_the_rest_can_be_built_here(self):
        build = self.start(16384, 8)
        # The stopped task does not end, so this machine has to build its batch.
        stopped = self.a_task()
        os.kill(stopped, signal.SIGSTOP)
        self.wait_for(lambda: list(self.work.glob("segment-*.vdseg")), "accepted batch")
        build.kill()
        self.end(build)
        done = subprocess.run([VOXDAG, "build", self.scene, "-r", "16384", "-o", self.output,
                               "--json"], capture_output=True, text=True, check=True)
        report = json.loads(done.stdout)
        self.assertEqual(report["sha256"], self.sha256(16384))
        self.assertGreater(report["subvolumes"]["reused"], 0)

    def test_torn_and_foreign_records_do_not_count(self):
        # The option --begin delays the tasks, so that the damaged records exist before they start.
        build = self.start(16384, 4, "--cluster-options", "--begin=now+4")
        folder = self.work / "cluster"
        self.wait_for(lambda: list(folder.glob("batch-3.vdbatch")), "batch")
        (folder / "batch-3.record-torn.json").write_text('{"program": "0.1.0", "bui')
        (folder / "batch-2.record-foreign.json").write_text("{}\n17\n")
        _, messages = self.finish(build, 16384)
        self.assertIn("batch-3.record-torn.json is rejected: it fails its checksum", messages)
        self.assertIn("batch-2.record-foreign.json is rejected: it fails its checksum", messages)

    def test_a_requeued_task(self):
        build = self.start(16384, 4)
        self.wait_for(self.tasks, "running task")
        running = self.cluster.command("squeue", "--noheader", "--array", "--states=RUNNING",
                                       "--format=%F_%K").stdout.split()
        self.cluster.command("scontrol", "requeue", random.choice(running))
        report, _ = self.finish(build, 16384)
        self.assertEqual(report["cluster"]["failed_attempts"], 0)

    def test_the_shared_disk_is_full(self):
        if os.geteuid() != 0:
            self.skipTest("only root may mount a small disk")
        disk = self.folder / "small"
        disk.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", disk], check=True)
        self.addCleanup(lambda: subprocess.run(["umount", "--lazy", disk], check=True))
        self.work = disk / "work"
        options = ["--work", str(self.work), "--cluster-retries", "1"]
        build = self.start(16384, 4, *options)
        self.wait_for(lambda: list(self.work.glob("cluster/batch-3.vdbatch")), "batch")
        filler = disk / "filler"
        with self.assertRaises(OSError), open(filler, "wb", buffering=0) as file:
            while True:
                file.write(bytes(1 << 16))
        _, messages = self.end(build)
        self.assertNotEqual(build.returncode, 0)
        self.assertRegex(messages, "disk is full|No space left on device")
        filler.unlink()
        self.finish(self.start(16384, 4, *options), 16384)

    def test_the_service_builds_on_the_cluster(self):
        folder = self.folder / "service"
        with Service(VOXDAG, folder, self.scene, self.cluster.environment) as service:
            # The build takes so long that the service queries Slurm while tasks run.
            job = service.submit(131072)
            self.wait_for(lambda: service.tasks(job), lambda: f"tasks in {service.job(job)}", 20)
            shown = service.job(job)["progress"]["cluster"]
            self.assertEqual(shown["batches"], 8)
            self.assertTrue(all(node["name"] in self.cluster.nodes for node in shown["nodes"]))
            metrics = service.get("/metrics").decode()
            self.assertRegex(metrics, r"voxdag_cluster_tasks_running [1-8]")
            service.action(job, "cancel")
            self.wait_for(lambda: service.job(job)["state"] == "canceled", "canceled job")
            self.wait_for(lambda: not self.queue(), "empty queue")
            service.action(job, "retry")
            self.wait_for(self.queue, "tasks of the second attempt")
            service.kill()
            self.assertTrue(self.queue(), "the tasks do not run on")
            service.start()
            self.wait_for(lambda: service.job(job)["state"] == "succeeded", "result", 120)
            self.assertEqual(service.job(job)["result"]["sha256"], self.sha256(131072))

    def start_with_merge_job(self, *options):
        return self.start(16384, 4, "--cluster-merge", *options)

    def wait_for_merge_job(self):
        self.wait_for(lambda: "-merge" in self.cluster.command(
            "squeue", "--noheader", "--format=%j").stdout, "job that merges")
        return self.task_name() + "-merge"

    def test_the_merge_job_needs_nobody(self):
        build = self.start_with_merge_job()
        name = self.wait_for_merge_job()
        build.kill()
        self.end(build)
        self.wait_for(lambda: not self.work.exists(), "finished build")
        self.wait_for_tasks(name, {"COMPLETED": 1})
        report, _ = self.finish(self.start_with_merge_job(), 16384)
        self.assertEqual(report, json.loads(Path(f"{self.output}.report.json").read_text()))
        self.assertEqual(report["cluster"]["batches"], 4)
        self.assertEqual(self.queue(), "", "something was submitted again")

    def test_a_killed_merge_job_is_submitted_again(self):
        build = self.start_with_merge_job()
        stopped = self.a_task()
        os.kill(stopped, signal.SIGSTOP)
        name = self.wait_for_merge_job()
        # The interrupted build leaves its tasks running, and the next start attaches to them.
        build.send_signal(signal.SIGINT)
        _, messages = self.end(build)
        self.assertIn("and its tasks run on", messages)
        build = self.start_with_merge_job()
        time.sleep(1)
        self.cluster.command("scancel", f"--name={name}")
        _, messages = self.end(build)
        self.assertEqual(build.returncode, 6)
        self.assertRegex(messages, r"job \d+ that merges has ended without a result: CANCELLED")
        os.kill(stopped, signal.SIGCONT)
        report, _ = self.finish(self.start_with_merge_job(), 16384)
        self.assertEqual(report["cluster"]["batches"], 4)
        self.wait_for_tasks(name, {"CANCELLED": 1, "COMPLETED": 1})

    @slow
    def test_a_task_that_is_out_of_time(self):
        build = self.start(16384, 4, "--cluster-options", "--time=1")
        os.kill(self.a_task(), signal.SIGSTOP)
        report, messages = self.finish(build, 16384)
        self.assertRegex(messages, "TIMEOUT.*; it is split and submitted again")
        self.assertEqual(report["cluster"]["batches"], 5)
        self.assertEqual(report["cluster"]["failed_attempts"], 1)

    @slow
    def test_a_task_that_is_out_of_memory(self):
        # A task needs more than 8 MB of memory. Without cgroups, Slurm can report FAILED or
        # CANCELLED instead of OUT_OF_MEMORY.
        build = self.start(32768, 2, "--cluster-options", "--mem=8M", "--cluster-retries", "0")
        _, messages = self.end(build)
        self.assertEqual(build.returncode, 10, messages)
        self.assertRegex(messages, "(OUT_OF_MEMORY|FAILED|CANCELLED).*; it has failed 1 times")
        self.assertIn("exceeded memory limit", self.logs())
        self.finish(self.start(32768, 2, "--cluster-options", "--mem=1G"), 32768)

    @slow
    def test_a_preempted_task(self):
        build = self.start(16384, 4)
        node, pids = random.choice(sorted(self.wait_for(self.tasks, "running task").items()))
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        self.cluster.command("sbatch", "--partition=urgent", f"--nodelist={node}", "--exclusive",
                             "--output=/dev/null", "--wrap=sleep 1")
        report, _ = self.finish(build, 16384)
        self.assertEqual(report["cluster"]["batches"], 4)
        self.assertFalse(any(Path(f"/proc/{pid}").exists() for pid in pids), "not preempted")

    @slow
    def test_twenty_random_kills(self):
        build = self.start(65536, 24, "--cluster-retries", "30")
        self.wait_for(self.tasks, "running task")
        name = self.task_name()
        kills = 0
        while build.poll() is None and kills < 20:
            time.sleep(random.uniform(0.02, 0.2))
            running = self.tasks()
            if not running:
                continue
            if random.random() < 0.15:
                node = random.choice(sorted(running))
                self.cluster.kill_machine(node)
                self.cluster.start_node(node)
            else:
                os.kill(random.choice(random.choice(list(running.values()))), signal.SIGKILL)
            kills += 1
        report, _ = self.finish(build, 65536)
        print(f"{kills} kills, {report['cluster']['failed_attempts']} failed attempts", flush=True)
        self.assertEqual(kills, 20)
        # Exactly one task was submitted for each batch and for each failed attempt, so no batch
        # with a completion record was submitted again.
        self.assertEqual(sum(self.submitted(name).values()),
                         report["cluster"]["batches"] + report["cluster"]["failed_attempts"])


if __name__ == "__main__":
    VOXDAG = os.path.abspath(sys.argv.pop(1))
    if missing := missing_programs():
        print(f"skipped: {', '.join(missing)} not installed (tools/packages cluster)")
        sys.exit(SKIPPED)
    unittest.main(verbosity=2)
