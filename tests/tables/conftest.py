from __future__ import annotations

import pytest

from benchharness.tables import compare, results


@pytest.fixture
def judge(tmp_path):
    """Two lists of records -> verdict, through the files."""

    def run(old, new, **options):
        for name, records in (("base", old), ("new", new)):
            results.write_results(tmp_path / name, records)
        return compare.compare(tmp_path / "base", tmp_path / "new", **options)

    return run


@pytest.fixture
def judge_runs(tmp_path):
    """Two lists of runs, each a list of records -> verdict, through the files."""

    def run(old, new, **options):
        for side, tables in (("base", old), ("new", new)):
            for number, records in enumerate(tables):
                results.write_results(tmp_path / side / f"{number + 1:02d}", records)
        return compare.compare(tmp_path / "base", tmp_path / "new", **options)

    return run
