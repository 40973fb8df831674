"""`topobelief reproduce` on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reproductions import SMALLEST, copy_of_smallest_reproduction
from topobelief.cli.app import run
from topobelief.reproduction.plan import ReproductionPlan
from topobelief.runs.local_workers import LocalWorkers


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A folder that holds the smallest reproduction, which --quick then stands for."""
    pytest.importorskip("plotly")
    copy_of_smallest_reproduction(tmp_path / "out")
    monkeypatch.setattr(ReproductionPlan, "for_a_first_look", staticmethod(lambda **_: SMALLEST))
    return tmp_path / "out"


def test_everything_lands_in_the_folder(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["reproduce", "--quick", "--json", "--out", str(small)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "topobelief.claims/1"
    assert len(document["claims"]) > 40
    assert {claim["holds"] for claim in document["claims"]} == {True, False}
    tables = {path.stem for path in (small / "tables").glob("*.csv")}
    assert tables == {
        *("planning_sessions", "time_per_action", "random_graphs", "bounds_quality", "path_length"),
        *("real_graphs", "real_bounds", "anytime", "claims"),
        *("entropy_or_error", "entropy_or_error_summary", "beyond_candidates", "beyond_candidates_summary"),
    }
    pngs, pdfs = ({path.stem for path in (small / "figures").glob(f"*.{suffix}")} for suffix in ("png", "pdf"))
    assert pngs == pdfs
    assert len(pngs) == 12
    text = (small / "report.html").read_text(encoding="utf-8")
    assert all(f'id="figure-{name}"' in text for name in pngs)
    table = (small / "claims.md").read_text(encoding="utf-8").splitlines()
    assert sum(line.startswith("| ") for line in table) == len(document["claims"]) + sum(
        line.startswith("|-") for line in table
    )


def test_bad_input_is_one_line_and_leaves_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("plotly")
    out = tmp_path / "out"
    assert run(["reproduce", str(tmp_path / "none.g2o"), "--quick", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "expected a pose graph to read, got no such file" in said
    assert not out.exists()


def test_another_runs_folder_is_refused(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (small / "journal.jsonl").read_bytes()
    assert run(["reproduce", "--seed", "7", "--out", str(small)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "expected a run with the same settings, seed 7, got seed 0; choose another --out" in said
    assert (small / "journal.jsonl").read_bytes() == before


def test_an_interrupted_run_keeps_its_parts_and_says_so(
    small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = small / "journal.jsonl"
    before = journal.read_text(encoding="utf-8")
    kept = before.splitlines(keepends=True)[:-3]
    journal.write_text("".join(kept), encoding="utf-8")

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(LocalWorkers, "run", interrupt)
    assert run(["reproduce", "--quick", "--out", str(small)]) == 130
    said = capsys.readouterr()
    assert "the same command continues" in said.out
    assert "interrupted" in said.err
    assert journal.read_text(encoding="utf-8") == "".join(kept)
