"""The same study on a real dask scheduler with two worker processes, which come to harm."""

from __future__ import annotations

import os
import random
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from study_plays import deadly, failing, hanging, quick, slow
from topobelief.errors import InvalidInputError
from topobelief.runs import cluster
from topobelief.runs.cluster import Cluster, ClusterLostError
from topobelief.runs.local_workers import LocalWorkers
from topobelief.study.dataset import Dataset, read_table, repeatable
from topobelief.study.runner import run_study

pytest.importorskip("distributed")


@dataclass
class Processes:
    """A scheduler and its workers, each under a nanny that puts another in the place of one that dies."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]

    def kill_a_worker(self, rng: random.Random) -> bool:
        """The process that plays, not its nanny."""
        psutil = pytest.importorskip("psutil")
        children = [child for nanny in self.workers for child in psutil.Process(nanny.pid).children(recursive=True)]
        playing = [child for child in children if "spawn_main" in " ".join(child.cmdline())]
        if playing:
            with suppress(psutil.NoSuchProcess):
                rng.choice(playing).kill()
        return bool(playing)


ALLOWED_FAILURES = 3  # of workers under one task, at a scheduler with default settings

Start = Callable[..., Processes]


@contextmanager
def clusters(folder: Path) -> Iterator[Start]:
    """What starts clusters, which end with the block; their processes find the stand-ins and leave marks in the folder."""
    paths = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), "STUDY_PLAYS_FOLDER": str(folder)}
    with ExitStack() as stack:

        def start(*, num_workers: int = 2) -> Processes:
            with closing(socket.socket()) as free:
                free.bind(("127.0.0.1", 0))
                port = free.getsockname()[1]
            address = f"tcp://127.0.0.1:{port}"

            def run(*arguments: str) -> subprocess.Popen[bytes]:
                command = [sys.executable, "-m", "dask", *arguments, "--no-dashboard", "--host", "127.0.0.1"]
                with (folder / "cluster.log").open("ab") as log:
                    process = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder, env=environment)
                stack.callback(process.wait)
                stack.callback(process.terminate)
                return process

            scheduler = run("scheduler", "--port", str(port))
            return Processes(address, scheduler, [run("worker", address, "--nthreads", "1") for _ in range(num_workers)])

        yield start


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    with clusters(tmp_path) as start:
        yield start


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """A cluster of two workers that recovers from what tests do to it."""
    with clusters(tmp_path_factory.mktemp("cluster")) as start:
        yield start()


def rows(folder: Path) -> bytes:
    return repeatable(read_table(folder)).combine_chunks().to_batches()[0].serialize().to_pybytes()


def test_a_cluster_gives_the_rows_of_this_machine(make_tasks, tmp_path, processes):
    address, tasks = processes.address, make_tasks(seeds="[5]")
    outcome = run_study(tasks, tmp_path / "far", Cluster(address))
    run_study(tasks, tmp_path / "near", LocalWorkers(1))
    assert (outcome.num_done_now, outcome.num_failed) == (len(tasks), 0)
    assert rows(tmp_path / "far") == rows(tmp_path / "near")

    failed = run_study(make_tasks(), tmp_path / "failing", Cluster(address), play=failing)  # the cluster serves the next study
    assert (failed.num_done_now, failed.num_failed) == (24, 16)


def test_workers_killed_at_random_lose_and_repeat_no_row(make_tasks, tmp_path, processes):
    rng, over = random.Random(3), threading.Event()
    tasks = make_tasks(seeds="8")
    kills = 0

    def kill_some() -> None:
        nonlocal kills
        while kills < ALLOWED_FAILURES and not over.wait(rng.uniform(0.3, 1.0)):
            kills += processes.kill_a_worker(rng)

    killer = threading.Thread(target=kill_some)
    with closing(Cluster(processes.address).run(quick, tasks[:1])) as warm_up:
        list(warm_up)  # so that workers are there to be killed
    killer.start()
    try:
        outcome = run_study(tasks, tmp_path / "out", Cluster(processes.address), play=slow)
    finally:
        over.set()
        killer.join()
    assert kills >= 1
    assert (outcome.num_done_now, outcome.num_failed) == (len(tasks), 0)
    assert sorted(read_table(tmp_path / "out")["task"].to_pylist()) == sorted(task.id for task in tasks)


def test_a_task_that_kills_its_workers_is_blamed_alone(make_tasks, tmp_path, processes):
    tasks = make_tasks(strategies="[random]")[:12:4]
    outcome = run_study(tasks, tmp_path / "out", Cluster(processes.address), play=deadly)
    table = read_table(tmp_path / "out")
    status = dict(zip(table["seed"].to_pylist(), table["status"].to_pylist(), strict=True))
    assert status == {0: "ok", 1: "failed", 2: "ok"}
    assert outcome.first_error is not None
    assert outcome.first_error.startswith("WorkerDiedError: several workers of the cluster died over it")


def test_a_task_that_hangs_is_ended(make_tasks, tmp_path, processes):
    tasks = make_tasks(strategies="[random]")[:12:4]
    outcome = run_study(tasks, tmp_path / "out", Cluster(processes.address, max_seconds=0.5), play=hanging)
    table = read_table(tmp_path / "out")
    assert dict(zip(table["seed"].to_pylist(), table["status"].to_pylist(), strict=True)) == {0: "ok", 1: "failed", 2: "ok"}
    assert "took too long" in str(outcome.first_error)


def test_a_scheduler_that_goes_away_ends_the_run_and_the_next_continues(make_tasks, tmp_path, start, plays_folder):
    processes, tasks = start(), make_tasks()

    def end_it(progress) -> None:
        if progress.done == 3:
            processes.scheduler.kill()

    with pytest.raises(ClusterLostError, match="run the same command to continue"):
        run_study(tasks, tmp_path / "out", Cluster(processes.address), play=slow, on_progress=end_it)
    kept = len(Dataset(tmp_path / "out"))
    assert 3 <= kept < len(tasks)
    outcome = run_study(tasks, tmp_path / "out", LocalWorkers(2), play=quick)
    assert (outcome.num_done_now, outcome.num_failed) == (len(tasks) - kept, 0)


def test_no_scheduler_and_no_worker(make_tasks, tmp_path, start, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE", 2)
    with pytest.raises(InvalidInputError, match=r"expected a dask scheduler at tcp://127\.0\.0\.1:9, got no answer"):
        run_study(make_tasks(), tmp_path / "out", Cluster("tcp://127.0.0.1:9"))
    monkeypatch.setattr(cluster, "_PATIENCE", 10)
    address = start(num_workers=0).address
    with pytest.raises(InvalidInputError, match="expected a worker at the scheduler"):
        run_study(make_tasks(), tmp_path / "out", Cluster(address))


def test_a_worker_with_another_version_is_refused(make_tasks, tmp_path, processes, monkeypatch):
    monkeypatch.setattr(cluster, "_own_version", lambda: "99")
    with pytest.raises(InvalidInputError, match=r"expected topobelief 99 on all workers, got \d"):
        run_study(make_tasks(), tmp_path / "out", Cluster(processes.address))
