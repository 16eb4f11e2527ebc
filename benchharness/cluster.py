"""Gives the jobs of a run to a `distributed` cluster, one job per machine at a time.

The workers need the same environment and the same file system as this machine: plugins, meshes and the run folder are
named by path. Times of several machines end up in one table, each related by its own `calibration_ms`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchharness import platform, supervisor
from benchharness.config import Job


def execute_on(
    address: str, jobs: Sequence[Job], setting: supervisor.Setting, pasts: Sequence[supervisor.Past]
) -> Iterator[dict]:
    """Lines of the journal, as the jobs end. Raises ValueError without `distributed`, or for no such scheduler."""
    try:
        from distributed import Client, as_completed  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ValueError(
            '--cluster needs the package distributed; accepted: pip install "benchharness[cluster]", or no --cluster'
        ) from None
    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        raise ValueError(f"--cluster {address}: no scheduler answers ({error}); accepted: tcp://HOST:PORT") from None
    with client:
        futures = [
            client.submit(_whole, number, job, setting, past, pure=False, retries=0)
            for number, (job, past) in enumerate(zip(jobs, pasts, strict=True))
        ]
        for future in as_completed(futures):
            yield from future.result()


def _whole(number: int, job: Job, setting: supervisor.Setting, past: supervisor.Past) -> list[dict]:
    """On a machine of the cluster: a job from beginning to end, alone."""
    with platform.alone(lambda text: None):
        return list(supervisor.execute(number, job, setting, past))
