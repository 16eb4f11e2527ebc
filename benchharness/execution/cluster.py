"""Gives the jobs of a run to a `distributed` cluster. On each machine one frame is timed at a time.

The workers need the same environment and the same file system as this machine: plugins, meshes and the run folder are
named by path. Times of several machines end up in one table, each related by its own `calibration_ms`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from benchharness.execution import attempt, supervisor
from benchharness.study.config import Job

CONNECT_S = 15.0
WORKERS_S = 60.0
"""How long a scheduler may have no workers."""


@contextmanager
def connected(address: str, tell: Callable[[str], None]) -> Iterator[Any]:
    """A client of the scheduler at `address`, which has workers. `tell` hears what is waited for.

    Raises ValueError without `distributed`, for no such scheduler, and for one without workers.
    """
    try:
        from distributed import Client  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ValueError(
            '--cluster needs the package distributed; accepted: pip install "benchharness[cluster]", or no --cluster'
        ) from None
    tell(f"asking for a scheduler at {address}, for {CONNECT_S:g} s at most")
    try:
        client = Client(address, timeout=CONNECT_S)
    except Exception as error:  # of many kinds: addresses that are none, sockets, TLS, versions, time
        raise ValueError(f"--cluster {address}: no scheduler answers ({error}); accepted: tcp://HOST:PORT") from None
    with client:
        if not client.scheduler_info()["workers"]:
            tell(f"the scheduler has no workers; waiting for one, for {WORKERS_S:g} s at most")
            try:
                client.wait_for_workers(1, timeout=WORKERS_S)
            except TimeoutError:
                raise ValueError(f"--cluster {address}: the scheduler has no workers; accepted: one with workers") from None
        yield client


def execute_on(client: Any, setting: attempt.Setting, tasks: Sequence[tuple[int, Job, supervisor.Past]]) -> Iterator[dict]:
    """Lines of the journal, as the jobs end. Where one was lost, with its machine or with the scheduler, a note says so."""
    from distributed import as_completed  # pyright: ignore[reportMissingImports]

    futures = {
        client.submit(_whole, number, job, setting, past, pure=False, retries=0): (number, job) for number, job, past in tasks
    }
    for future in as_completed(futures):
        number, job = futures[future]
        try:
            lines = future.result()
        except Exception as error:  # whatever ended the job there, and the loss of the scheduler
            reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
            yield {"job": number, "note": f"{job.facts['scene']}: lost by the cluster: {reason}; --resume does it"}
        else:
            yield from lines


def _whole(number: int, job: Job, setting: attempt.Setting, past: supervisor.Past) -> list[dict]:
    """On a machine of the cluster: a job from beginning to end, of which nobody hears before it."""
    return [line for line in supervisor.execute(number, job, setting, past) if "makes" not in line]
