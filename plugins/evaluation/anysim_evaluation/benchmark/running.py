"""Running a benchmark: jobs of one task on one engine in worker processes, which go on where they were cut off."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from anysim.api import make
from anysim.errors import AnysimError, CapabilityError, RecordError, TaskError
from anysim.record.commit import write_whole
from anysim.record.incoming import FileLock, claim
from anysim.task.contract import Status
from anysim_evaluation.benchmark.freezing import of_cell
from anysim_evaluation.benchmark.protocol import Protocol, overrides
from anysim_evaluation.benchmark.results import Cell
from anysim_evaluation.driver import Episode, drive
from anysim_evaluation.log import FILE, EpisodeLog, identity, read_log
from anysim_evaluation.policy import make_policy
from anysim_evaluation.sharing import Answer, Answerer, Question, portions
from anysim_processes.executors import share

WATCH_S = 0.2
"""How often a worker looks whether its parent is there, and a parent what its workers have done [s]."""
COST = "cost.jsonl"
"""CPU seconds of the episodes, in the folder of the cell: no figures of the benchmark, no two runs have the same."""
ABSENT = "absent.json"
"""Why a policy cannot be run on an engine, in the folder of the cell."""
WORKER = ".worker"
"""The end of the name of a file that a worker keeps locked."""

Tell = Callable[[str], object]


class Job(NamedTuple):
    """The policies that are left on one task and engine.

    Attributes:
        parts: what is frozen, of which each log says what it depends on.
    """

    protocol: Protocol
    parts: Mapping[str, str]
    out: Path
    task: str
    engine: str
    policies: Sequence[str]


def cells(protocol: Protocol, only: str = "") -> list[Cell]:
    """The cells of a protocol; `only` is TASK/ENGINE/POLICY, where what is left out or `*` stands for all.

    Raises:
        TaskError: it names something that the protocol does not have.
    """
    spec = protocol.spec
    known = (spec.tasks, spec.engines, spec.policies)
    wanted = [word if word != "*" else "" for word in only.split("/")]
    for word, there, kind in zip(wanted, known, ("task", "engine", "policy"), strict=False):
        if word and word not in there:
            raise TaskError(f"--only {only}: the protocol has no {kind} '{word}'; it has {', '.join(there)}")
    if len(wanted) > len(known):
        raise TaskError(f"--only {only}: expected TASK/ENGINE/POLICY, as in reach/mujoco or */*/expert")
    chosen = [*wanted, "", "", ""]
    return [
        Cell(task, engine, policy)
        for task in spec.tasks
        for engine in spec.engines
        for policy in spec.policies
        if chosen[0] in ("", task) and chosen[1] in ("", engine) and chosen[2] in ("", policy)
    ]


def folder(out: Path, cell: Cell) -> Path:
    """Where the episodes of a cell are."""
    return out.joinpath(*cell)


def logged(protocol: Protocol, parts: Mapping[str, str], out: Path) -> dict[Cell, dict[int, Episode]]:
    """The episodes that are there, of all cells.

    Raises:
        RecordError: those of another protocol, or no logs.
    """
    seeds = protocol.seeds()
    found: dict[Cell, dict[int, Episode]] = {}
    for cell in cells(protocol):
        path = folder(out, cell) / FILE
        log = read_log(path)
        if log.what and log.what.get("frozen") != of_cell(parts, *cell):
            raise RecordError(
                f"{path} has episodes of a protocol that was frozen otherwise; run into another directory"
            )
        found[cell] = {seed: log.episodes[seed] for seed in seeds if seed in log.episodes}
    return found


def absences(protocol: Protocol, out: Path) -> Iterator[dict[str, str]]:
    """The cells that cannot be run, each with the reason."""
    for cell in cells(protocol):
        path = folder(out, cell) / ABSENT
        if path.exists():
            yield {**cell._asdict(), "why": json.loads(path.read_text("utf-8"))["why"]}


def run(
    protocol: Protocol,
    parts: Mapping[str, str],
    out: Path,
    *,
    only: str = "",
    workers: int | None = None,
    executor: str | None = None,
    tell: Tell,
) -> None:
    """Run what is left. Each episode is on the disk once it has ended, whatever becomes of this process.

    Results depend neither on the number of workers nor on how often it was cut off. `tell` is called with a line for
    each episode. With more than one worker the main module of a program that calls this is guarded. With an `executor`
    its workers run the episodes, and this process writes them down.

    Raises:
        RecordError: the directory has other episodes, or another process runs there.
        TaskError: a worker process died; what it had done is kept.
    """
    with claim(out):
        _wait_for_orphans(out)
        there = logged(protocol, parts, out)
        episodes = len(protocol.seeds())
        left: dict[tuple[str, str], list[str]] = {}
        for cell in cells(protocol, only):
            if len(there[cell]) < episodes:
                left.setdefault((cell.task, cell.engine), []).append(cell.policy)
        work = [Job(protocol, parts, out, task, engine, policies) for (task, engine), policies in left.items()]
        work.sort(key=lambda job: -len(job.policies) * int(parts[f"tasks.{job.task}.horizon"].split()[0]))
        if executor is not None:
            _share_out(work, there, executor, workers, tell)
        elif workers in (None, 1) or len(work) < 2:
            for job in work:
                run_job(job, tell)
        else:
            _share(work, out, min(workers or 1, len(work)), tell)
            _wait_for_orphans(out)


def run_job(job: Job, tell: Tell) -> None:
    """Run the policies of one task on one engine, in one env after the other."""
    protocol, spec = job.protocol, job.protocol.spec
    chosen, task = spec.engines[job.engine], spec.tasks[job.task]
    at = [Cell(job.task, job.engine, policy) for policy in job.policies]
    engine: dict[str, Any] = {"name": chosen.engine, "options": chosen.options}
    num_envs = min(spec.num_envs, spec.seeds.episodes)
    try:
        env = make(protocol.source(job.task), engine=engine, num_envs=num_envs, overrides=overrides(task))
    except CapabilityError as error:
        for cell in at:
            _absent(job, cell, error, tell)
        return
    with env:
        for cell in at:
            policy = spec.policies[cell.policy]
            try:
                driven = make_policy(env, policy.policy)
            except TaskError as error:
                _absent(job, cell, error, tell)
                continue
            what = identity(env, policy.policy, driven, policy.privileged) | {"frozen": of_cell(job.parts, *cell)}
            (folder(job.out, cell) / ABSENT).unlink(missing_ok=True)
            with EpisodeLog(folder(job.out, cell), what) as log:
                left = [seed for seed in protocol.seeds() if seed not in log.episodes]
                began = time.process_time()
                for episode in drive(env, driven, left, privileged=policy.privileged, groups=spec.modality):
                    log.add(episode)
                    _charge(folder(job.out, cell) / COST, episode.seed, time.process_time() - began)
                    began = time.process_time()
                    tell(f"{'/'.join(cell)} seed {episode.seed}: {episode.failure or 'success'}")


def _charge(path: Path, seed: int, cpu_s: float) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"seed": seed, "cpu_s": round(cpu_s, 4)}) + "\n")


def costs(out: Path, found: Mapping[Cell, Mapping[int, Episode]]) -> Iterator[dict[str, Any]]:
    """CPU seconds of each cell by its successes, from the episodes whose cost was kept; None where none succeeded."""
    for cell, episodes in found.items():
        path = folder(out, cell) / COST
        kept = map(json.loads, path.read_text("utf-8").splitlines() if path.exists() else ())
        spent = {row["seed"]: row["cpu_s"] for row in kept if row["seed"] in episodes}
        if spent:
            won = sum(episodes[seed].status == Status.SUCCESS for seed in spent)
            cpu_s = round(sum(spent.values()), 3)
            of_success = round(cpu_s / won, 4) if won else None
            yield {**cell._asdict(), "episodes": len(spent), "cpu_s": cpu_s, "cpu_s_per_success": of_success}


def _absent(job: Job, cell: Cell, error: AnysimError, tell: Tell) -> None:
    where = folder(job.out, cell)
    where.mkdir(parents=True, exist_ok=True)
    write_whole(where, {ABSENT: json.dumps({"why": str(error)}) + "\n"})
    tell(f"{'/'.join(cell)} cannot be run: {error}")


# ------------------------------------------------------------------ workers of an executor


class _Part(NamedTuple):
    """Some seeds of a cell; `question` is what is asked of its policy."""

    cell: Cell
    question: Question
    seeds: tuple[int, ...]


def _share_out(
    work: Sequence[Job], there: Mapping[Cell, Mapping[int, Episode]], executor: str, workers: int | None, tell: Tell
) -> None:
    """Have the episodes run by an executor's workers; what an episode cost is its share of what it was run with."""
    jobs = {(job.task, job.engine): job for job in work}
    items = [(part,) for job in work for part in _parts(job, there)]
    for part, answer, cpu_s in share(executor, items, _answering, workers):
        job = jobs[part.cell.task, part.cell.engine]
        if isinstance(answer, AnysimError):
            _absent(job, part.cell, answer, tell)
            continue
        where = folder(job.out, part.cell)
        (where / ABSENT).unlink(missing_ok=True)
        with EpisodeLog(where, answer.what | {"frozen": of_cell(job.parts, *part.cell)}) as log:
            for episode in answer.episodes:
                log.add(episode)
                _charge(where / COST, episode.seed, cpu_s / len(answer.episodes))
                tell(f"{'/'.join(part.cell)} seed {episode.seed}: {episode.failure or 'success'}")


def _parts(job: Job, there: Mapping[Cell, Mapping[int, Episode]]) -> Iterator[_Part]:
    spec = job.protocol.spec
    engine, task = spec.engines[job.engine], spec.tasks[job.task]
    num_envs = min(spec.num_envs, spec.seeds.episodes)
    for name in job.policies:
        cell, policy = Cell(job.task, job.engine, name), spec.policies[name]
        question = Question(
            job.protocol.source(job.task),
            {"name": engine.engine, "options": engine.options},
            num_envs,
            tuple(overrides(task)),
            policy.policy,
            policy.privileged,
            None if spec.modality is None else tuple(spec.modality),
        )
        left = [seed for seed in job.protocol.seeds() if seed not in there[cell]]
        for seeds in portions(left, num_envs):
            yield _Part(cell, question, seeds)


@contextmanager
def _answering() -> Iterator[Callable[[_Part], tuple[_Part, Answer | AnysimError, float]]]:
    with closing(Answerer()) as answerer:

        def answer(part: _Part) -> tuple[_Part, Answer | AnysimError, float]:
            began = time.process_time()
            try:
                answerer.prepare(part.question)
            except (CapabilityError, TaskError) as error:
                return part, TaskError(str(error)), 0.0
            return part, answerer.answer(part.question, part.seeds), time.process_time() - began

        yield answer


# ------------------------------------------------------------------ worker processes


class _Stopped(Exception):
    """The parent wants no more episodes."""


_told: Any = None
"""The queue of a worker to its parent."""
_stop: Any = None
_alive: FileLock | None = None
"""What says that a worker lives; the kernel lets go of it."""


def _share(work: Sequence[Job], out: Path, workers: int, tell: Tell) -> None:
    context = get_context("spawn")
    queue, stop = context.SimpleQueue(), context.Event()
    with ProcessPoolExecutor(workers, context, initializer=_begin, initargs=(os.getpid(), out, queue, stop)) as pool:
        waiting: set[Future[None]] = {pool.submit(_work, job) for job in work}
        try:
            while waiting:
                done, waiting = wait(waiting, timeout=WATCH_S)
                while not queue.empty():
                    tell(queue.get())
                for future in done:
                    future.result()
        except BrokenProcessPool:
            words = "a worker process died; the same command again goes on where it was"
            raise TaskError(f"{words}, and with --workers 1 it says why") from None
        except BaseException:
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _wait_for_orphans(out: Path) -> None:
    """Wait until no worker of a process that is gone writes there; they look after their parent."""
    for path in out.glob(f"*{WORKER}"):
        lock = FileLock.take(path, wait=True)
        if lock is not None:
            lock.release()


def _begin(parent: int, out: Path, queue: Any, stop: Any) -> None:
    global _told, _stop, _alive
    _told, _stop, _alive = queue, stop, FileLock.take(out / f"{os.getpid()}{WORKER}")
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it reaches the parent, which says that no more are begun

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os._exit(1)  # what had ended is on the disk

    threading.Thread(target=watch, name="anysim-benchmark-parent", daemon=True).start()


def _tell(line: str) -> None:
    _told.put(line)
    if _stop.is_set():
        raise _Stopped


def _work(job: Job) -> None:
    try:
        run_job(job, _tell)
    except _Stopped:
        return
    except AnysimError as error:
        raise TaskError(str(error)) from None  # errors that hold more than words do not survive the way back
