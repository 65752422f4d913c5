"""`cell study`: is the measuring system good enough, and where does its scatter come from."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cell.cli.study_offsets import study_offsets
from cell.cli.words import answers, print_json
from cell.core.errors import IN_TOLERANCE, OUT_OF_TOLERANCE

if TYPE_CHECKING:
    from cell.metrology.study.studies import Interval, Type1, Type3
    from cell.programs.study import Finding, Repeatability

study_app = typer.Typer(
    name="study", no_args_is_help=True,
    help="""Study the measuring system from what it has measured.

FILE: recordings (.rrd), each of them a part by its body's number; or CSV with a column `id`, some
of `x,y,z,d` in mm, and where known `approach` (the robot left and came back), `location` (the body
was taken out and put back) and `part`.

Ends with 0 where every index was reached, 1 where one was missed or refused, 2 where a file cannot
be read. `offsets` is another thing: it learns the correlation to a CMM from recordings.""")
study_app.command("offsets")(study_offsets)

FILES = typer.Argument(..., metavar="FILE…", help="Tables of measured values.")
CONFIDENCE = typer.Option(0.95, min=0.5, max=0.9999, help="Two-sided confidence of the bounds.")
JSON = typer.Option(False, "--json", help="Print one JSON object.")


@study_app.command("repeatability")
def study_repeatability(files: list[Path] = FILES, confidence: float = CONFIDENCE,
                        as_json: bool = JSON) -> None:
    """Scatter of repeated measurements: s with bounds, split into sensor, robot and location."""
    from cell.programs import study

    findings = study.study_repeatability(study.read_samples(files), confidence)
    _answer(findings, "s = sqrt(sum (y - mean)² / (n - 1)); split by nested random ANOVA",
            as_json, _say_repeatability)
    raise typer.Exit(_code(all(f.answer is not None for f in findings)))


@study_app.command("type1")
def study_type1(files: list[Path] = FILES,
                reference: list[str] = typer.Option(..., "--reference", metavar="AXIS=MM",
                                                    help="The master's value, as x=12.345."),
                tolerance: float = typer.Option(..., min=1e-9, help="T, the full width in mm."),
                share: float = typer.Option(0.2, min=0.01, max=1.0, help="Share of T."),
                sigmas: float = typer.Option(6.0, min=1.0, help="Number of sigmas (6 or 4)."),
                limit: float = typer.Option(1.33, min=0.1, help="The least Cg and Cgk."),
                confidence: float = CONFIDENCE, as_json: bool = JSON) -> None:
    """Capability of the gauge on one master: Cg, Cgk and the t-test of the bias."""
    from cell.metrology.study.studies import Type1Rule
    from cell.programs import study

    rule = Type1Rule(share, sigmas, limit)
    findings = study.study_type1(study.read_samples(files), _references(reference), tolerance, rule,
                                 confidence)
    _answer(findings, f"Cg = {share} T / ({sigmas} s), Cgk = ({share / 2} T - |bias|) / "
            f"({sigmas / 2} s), limit {limit}, T = {tolerance} mm", as_json, _say_type1)
    raise typer.Exit(_code(all(f.answer is not None and f.answer.capable for f in findings)))


@study_app.command("type3")
def study_type3(files: list[Path] = FILES,
                tolerance: float = typer.Option(..., min=1e-9, help="T, the full width in mm."),
                confidence: float = CONFIDENCE, as_json: bool = JSON) -> None:
    """Share of the tolerance that the machine uses up, over several parts, without operators."""
    from cell.programs import study

    findings = study.study_type3(study.read_samples(files), tolerance, confidence)
    _answer(findings, f"EV² = MS within, PV² = (MS between - MS within)/r, %GRR = 600 EV/T, "
            f"T = {tolerance} mm", as_json, _say_type3)
    raise typer.Exit(_code(all(f.answer is not None and f.answer.judgement != "rejected"
                               for f in findings)))


def _references(texts: Sequence[str]) -> dict[str, float]:
    try:
        pairs = [text.split("=") for text in texts]
        return {axis.strip(): float(value) for axis, value in pairs}
    except ValueError as wrong:
        raise typer.BadParameter(f"expected AXIS=MM as in x=12.345, got {', '.join(texts)}",
                                 param_hint="--reference") from wrong


def _answer(findings: Sequence[Finding[Any]], formula: str, as_json: bool,
            sentence: Callable[[Any], str]) -> None:
    if as_json:
        print_json({"formula": formula, "studies": [_plain(finding) for finding in findings]})
        return
    answers.print(formula, style="bold", highlight=False, soft_wrap=True)
    for finding in findings:
        said = sentence(finding.answer) if finding.answer else f"refused: {finding.refused}"
        data = " ".join(f"{value:.4f}" for value in finding.sample.values)
        answers.print(f"\n{finding.sample.feature}.{finding.sample.axis}: {said}\n  data: {data}",
                      highlight=False, soft_wrap=True)


def _plain(finding: Finding[Any]) -> dict[str, Any]:
    sample = finding.sample
    head = {"id": sample.feature, "axis": sample.axis, "values": sample.values.tolist(),
            "labels": sample.labels, "refused": finding.refused or None}
    return head | ({"answer": _finite(asdict(finding.answer))} if finding.answer else {})


def _finite(value: object) -> object:
    """Replace infinite bounds by null, which JSON can say."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and math.isinf(value) else value


def _say_repeatability(found: Repeatability) -> str:
    spread = found.spread
    split = "; ".join(f"{part.cause} {part.sd:.4f} ({_bounds(part.interval)})"
                      for part in found.components)
    return (f"n {spread.n}, mean {spread.mean:.4f}, s {spread.sd:.4f} "
            f"({_bounds(spread.sd_interval)}), 6 s {6 * spread.sd:.4f}, range {spread.range:.4f} mm"
            f"\n  split: {split or 'not known, for want of a column `approach`'}")


def _say_type1(found: Type1) -> str:
    spread = found.spread
    return (f"{'capable' if found.capable else 'not capable'}: Cg {found.cg:.2f} (at least "
            f"{found.cg_low:.2f}), Cgk {found.cgk:.2f} (at least {found.cgk_low:.2f})\n"
            f"  n {spread.n}, mean {spread.mean:.4f}, s {spread.sd:.4f} mm; bias {found.bias:+.4f} "
            f"({_bounds(found.bias_interval)}), t {found.bias_t:.2f}, p {found.bias_p:.3f}"
            f"{': significant' if found.bias_significant else ''}; "
            f"least T for Cg {found.smallest_tolerance:.3f} mm")


def _say_type3(found: Type3) -> str:
    percent = found.grr_percent_interval
    return (f"{found.judgement}: %GRR {found.grr_percent:.1f} ({_bounds(percent, 1)})\n"
            f"  {found.parts} parts x {found.trials} trials, EV {found.ev:.4f} "
            f"({_bounds(found.ev_interval)}), PV {found.pv:.4f} mm, "
            f"ndc {'-' if found.ndc is None else found.ndc}")


def _bounds(interval: Interval, digits: int = 4) -> str:
    return f"{interval.low:.{digits}f} to {interval.high:.{digits}f}"


def _code(reached: bool) -> int:
    return IN_TOLERANCE if reached else OUT_OF_TOLERANCE
