"""`cell study offsets`: learn the CMM correlation offsets of a job."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.table import Table

from cell.cli.words import answers, console, print_json
from cell.core.errors import IN_TOLERANCE, OUT_OF_TOLERANCE

if TYPE_CHECKING:
    from cell.metrology.study.offsets import Learnt, OffsetsStudy
    from cell.programs.offsets import LearntOffsets


def study_offsets(
    logs: list[Path] = typer.Argument(..., metavar="LOG…", help="Recordings of the master body."),
    out: Path | None = typer.Option(None, help="Write the offsets to this file."),
    expires: int = typer.Option(90, min=1, max=3650, metavar="DAYS",
                                help="They hold for so many days after the last run."),
    by: str = typer.Option("", help="Who learns them; stands in the file."),
    replace: bool = typer.Option(False, "--replace", help="Replace the file if it exists."),
    as_json: bool = typer.Option(False, "--json", help="Print one JSON object."),
) -> None:
    """Learn CMM offsets: what a known body says of the sensor's error, by hole and axis.

    Measure the master body three times or more, under one number, then learn:

    `cell run jobs/demo.yaml --body MASTER` (three times)

    `cell study offsets logs/demo_*.rrd --out calibration/demo/offsets/demo.yaml`

    The CMM's values stand in the nominals, `cmm_x,cmm_y,cmm_z,cmm_d,cmm_u`; holes without are left
    out. An offset is CMM minus sensor, is added to what is measured from then on at that stop, and
    replaces the uncertainty of hand-eye, arm and registration by its own. Offsets are part of the
    calibration: approve them again for production.

    Ends with 0, or 1 where a hole that the CMM knows had to be left out.
    """
    from cell.programs.offsets import study_offsets, write_offsets

    learnt = study_offsets(logs, expires, by)
    if out is not None:
        write_offsets(learnt.study, out, anew=replace)
    if as_json:
        print_json(_describe(learnt, out))
    else:
        _show(learnt, out)
    raise typer.Exit(OUT_OF_TOLERANCE if _lost(learnt) else IN_TOLERANCE)


def _describe(learnt: LearntOffsets, out: Path | None) -> dict[str, Any]:
    first = learnt.recordings[0]
    return {"ok": True, "out": out and str(out), "job": first.papers.job.name,
            "cell": first.papers.station.name, "calibration_set": first.start.set_id,
            "body": first.start.body_id, "runs": [str(one.log) for one in learnt.recordings],
            "expires": learnt.expires,
            "offsets": [_describe_one(each) for each in learnt.study.learnt],
            "left_out": dict(learnt.study.left_out), "remarks": list(learnt.study.remarks)}


def _describe_one(each: Learnt) -> dict[str, Any]:
    return each.offset.model_dump() | {
        "u_mm": each.u, "cmm_mm": each.cmm, "measured_mm": each.measured,
        "t": each.t if abs(each.t) < float("inf") else None, "p": each.p,
        "significant": each.is_significant, "stated_u_mm": each.stated,
        "explained": each.is_explained}


def _show(learnt: LearntOffsets, out: Path | None) -> None:
    first, study = learnt.recordings[0], learnt.study
    answers.print(f"{first.papers.job.name} on {first.papers.station.name}, set "
                  f"{first.start.set_id}: {len(learnt.recordings)} runs over the body "
                  f"{first.start.body_id}; holds until {learnt.expires}", highlight=False)
    answers.print(_table(study))
    answers.print("offset = CMM - sensor; s of one run, and as pooled where that is more; u of the "
                  "offset; p of the t-test against 0", highlight=False)
    for reason in dict.fromkeys(study.left_out.values()):
        holes = [hole for hole, why in study.left_out.items() if why == reason]
        answers.print(f"left out: {', '.join(holes)}: {reason}", highlight=False, soft_wrap=True)
    for remark in study.remarks:
        answers.print(remark, highlight=False, soft_wrap=True)
    if out is None:
        console.print(f"nothing written: give --out {learnt.place}")
    else:
        console.print(f"written to {out}; the cell looks for it at {learnt.place}")


def _table(study: OffsetsStudy) -> Table:
    table = Table("hole", "axis", "CMM", "measured", "offset", "n", "s", "s used", "u", "p", "",
                  title="mm")
    for each in study.learnt:
        offset = each.offset
        table.add_row(offset.hole, offset.axis, f"{each.cmm:.4f}", f"{each.measured.mean():.4f}",
                      f"{offset.value_mm:+.4f}", str(offset.sample_size),
                      f"{offset.spread_mm:.4f}", f"{offset.repeatability:.4f}", f"{each.u:.4f}",
                      f"{each.p:.3f}", _word(each))
    return table


def _word(each: Learnt) -> str:
    if not each.is_explained:
        return "unexplained"
    return "significant" if each.is_significant else ""


def _lost(learnt: LearntOffsets) -> bool:
    """Whether a hole that the CMM knows is without offsets."""
    known = {hole.id for hole in learnt.recordings[0].papers.planned_holes if hole.cmm}
    return bool(known & learnt.study.left_out.keys())
