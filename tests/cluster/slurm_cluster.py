"""Runs a Slurm cluster on this machine, in a separate folder: munged, slurmctld and some slurmd,
each with a separate name and port. It needs neither systemd nor privileges. All processes end with
the context."""

import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

PROGRAMS = ["munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol", "scancel"]


def missing_programs():
    """Returns the required programs of Slurm and munge that are not installed."""
    path = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
    return [program for program in PROGRAMS if shutil.which(program, path=path) is None]


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


def running_tasks(work):
    """Returns, by node, the process ids of the running tasks that build in the folder `work`."""
    found = {}
    for entry in Path("/proc").iterdir():
        try:
            command = (entry / "cmdline").read_bytes().split(b"\0")
            if b"build-batch" not in command or str(work).encode() not in command:
                continue
            environment = (entry / "environ").read_bytes().split(b"\0")
        except OSError:
            continue
        for variable in environment:
            if variable.startswith(b"SLURMD_NODENAME="):
                found.setdefault(variable.split(b"=")[1].decode(), []).append(int(entry.name))
    return found


class SlurmCluster:
    """A cluster of `nodes` nodes with `cpus` CPUs each, all of them on this machine."""

    def __init__(self, folder, nodes=4, cpus=2, settings=""):
        self.folder = Path(folder)
        self.nodes = [f"n{i}" for i in range(1, nodes + 1)]
        self.cpus = cpus
        self.settings = settings
        self.processes = {}
        self.environment = dict(os.environ)
        self.environment["PATH"] += ":/usr/sbin:/sbin"
        self.environment["SLURM_CONF"] = str(self.folder / "slurm.conf")

    def __enter__(self):
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(self, *_):
        self.stop()

    def start(self):
        self.folder.mkdir(parents=True, exist_ok=True)
        # munged refuses a folder to which other users may write.
        self.folder.chmod(0o755)
        for name in ["munge", "state", "log"] + [f"spool-{node}" for node in self.nodes]:
            (self.folder / name).mkdir(exist_ok=True)
        (self.folder / "munge").chmod(0o755)
        key = self.folder / "munge" / "key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o600)
        self.write_configuration()
        munge = self.folder / "munge"
        self.spawn(
            "munged",
            [
                "munged",
                "--foreground",
                "--force",
                f"--socket={munge}/socket",
                f"--key-file={munge}/key",
                f"--pid-file={munge}/pid",
                f"--seed-file={munge}/seed",
                f"--log-file={munge}/log",
            ],
        )
        self.wait_for(lambda: (munge / "socket").exists(), "munged")
        self.start_controller()
        for node in self.nodes:
            self.start_node(node)
        self.wait_for_idle_nodes()

    def write_configuration(self):
        user = pwd.getpwuid(os.getuid()).pw_name
        self.controller_port, *self.node_ports = free_ports(1 + len(self.nodes))
        lines = [
            "ClusterName=test",
            "SlurmctldHost=localhost(127.0.0.1)",
            f"SlurmUser={user}",
            f"SlurmdUser={user}",
            f"SlurmctldPort={self.controller_port}",
            "AuthType=auth/munge",
            "CredType=cred/munge",
            f"AuthInfo=socket={self.folder}/munge/socket,cred_expire=5",
            f"StateSaveLocation={self.folder}/state",
            f"SlurmdSpoolDir={self.folder}/spool-%n",
            f"SlurmctldPidFile={self.folder}/slurmctld.pid",
            f"SlurmdPidFile={self.folder}/slurmd-%n.pid",
            f"SlurmctldLogFile={self.folder}/log/slurmctld",
            f"SlurmdLogFile={self.folder}/log/slurmd-%n",
            "ProctrackType=proctrack/linuxproc",
            "TaskPlugin=task/none",
            # Slurm kills a task that exceeds its memory allocation, within a second.
            "JobAcctGatherType=jobacct_gather/linux",
            "JobAcctGatherFrequency=task=1",
            "JobAcctGatherParams=OverMemoryKill",
            "AccountingStorageType=accounting_storage/none",
            "SelectType=select/cons_tres",
            "SelectTypeParameters=CR_CPU_Memory",
            "SchedulerParameters=batch_sched_delay=0,sched_interval=2,sched_min_interval=0",
            "MpiDefault=none",
            "SwitchType=switch/none",
            "ReturnToService=2",
            "SlurmdTimeout=10",
            "SlurmctldTimeout=10",
            "InactiveLimit=0",
            "KillWait=2",
            "MinJobAge=3600",
            "PreemptType=preempt/partition_prio",
            "PreemptMode=REQUEUE",
            "MaxArraySize=101",
            "SlurmdParameters=config_overrides",
            self.settings,
        ]
        for node, port in zip(self.nodes, self.node_ports):
            lines.append(
                f"NodeName={node} NodeHostname=localhost NodeAddr=127.0.0.1 Port={port} "
                f"CPUs={self.cpus} RealMemory=4096 State=UNKNOWN"
            )
        lines.append(
            f"PartitionName=all Nodes={','.join(self.nodes)} Default=YES MaxTime=INFINITE "
            "State=UP DefMemPerCPU=512"
        )
        lines.append(
            f"PartitionName=urgent Nodes={','.join(self.nodes)} PriorityTier=10 PreemptMode=OFF"
        )
        (self.folder / "slurm.conf").write_text("\n".join(lines) + "\n")

    def spawn(self, name, command):
        with open(self.folder / "log" / f"{name}.out", "ab") as log:
            self.processes[name] = subprocess.Popen(
                command, stdout=log, stderr=log, env=self.environment, start_new_session=True
            )

    def start_controller(self):
        self.spawn("slurmctld", ["slurmctld", "-D"])
        self.wait_for(
            lambda: self.command("scontrol", "ping", check=False).returncode == 0, "slurmctld"
        )

    def start_node(self, node):
        self.spawn(node, ["slurmd", "-D", "-N", node])

    def restart_nodes(self):
        for node in self.nodes:
            self.kill_machine(node)
        # Without the state "down", a job that is completing would occupy its node for a minute,
        # until Slurm polls the node.
        self.command(
            "scontrol", "update", f"nodename={','.join(self.nodes)}", "state=down", "reason=restart"
        )
        for node in self.nodes:
            self.start_node(node)
        self.wait_for_idle_nodes()

    def resume_nodes(self):
        """Resumes nodes that Slurm has marked as down or drained."""
        drained = self.command(
            "sinfo",
            "--noheader",
            "--Node",
            "--partition=all",
            "--states=drained,draining",
            "--format=%N",
            check=False,
        ).stdout.split()
        if drained:
            self.command(
                "scontrol", "update", f"nodename={','.join(drained)}", "state=resume", check=False
            )

    def wait_for_idle_nodes(self):
        def are_idle():
            # Slurm drains a restarted node if a task from before the restart is still on it.
            self.resume_nodes()
            return self.count_idle() == len(self.nodes)

        self.wait_for(are_idle, "idle nodes", 150)

    def kill(self, name, how=signal.SIGKILL):
        """Kills a daemon. The node's tasks keep running, as on a machine that lost its network."""
        process = self.processes.pop(name)
        process.send_signal(how)
        process.wait()

    def kill_machine(self, node):
        """Kills a node's daemon and all processes that it started."""
        self.kill(node)
        marker = f"SLURMD_NODENAME={node}".encode()
        for entry in Path("/proc").iterdir():
            if not entry.name.isdigit():
                continue
            try:
                environment = (entry / "environ").read_bytes().split(b"\0")
                if (
                    marker in environment
                    and f"SLURM_CONF={self.folder}/slurm.conf".encode() in environment
                ):
                    os.kill(int(entry.name), signal.SIGKILL)
            except OSError:
                continue

    def command(self, *command, check=True):
        return subprocess.run(
            command, env=self.environment, capture_output=True, text=True, timeout=60, check=check
        )

    def count_idle(self):
        shown = self.command(
            "sinfo", "--noheader", "--Node", "--partition=all", "--format=%N %T", check=False
        )
        return sum(line.split()[1:] == ["idle"] for line in shown.stdout.splitlines())

    def wait_for(self, condition, what, seconds=60):
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise RuntimeError(f"no {what} after {seconds} s:\n{self.logs()}")
            time.sleep(0.1)

    def logs(self):
        parts = [
            f"--- {log.name}\n{log.read_text(errors='replace')[-1500:]}"
            for log in sorted((self.folder / "log").iterdir())
        ]
        # The states of the nodes and jobs are most useful, so they are printed last.
        for command in (["sinfo", "--Node", "--long"], ["squeue"]):
            shown = self.command(*command, check=False)
            parts.append(f"--- {command[0]}\n{shown.stdout}{shown.stderr}")
        return "\n".join(parts)

    def stop(self):
        if "slurmctld" in self.processes:
            self.command("scancel", "--user", pwd.getpwuid(os.getuid()).pw_name, check=False)
        for node in self.nodes:
            if node in self.processes:
                self.kill_machine(node)
        for name in list(self.processes):
            self.kill(name)
