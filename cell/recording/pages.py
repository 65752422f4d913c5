"""The pages of a recording, one a record, checked against the hash chain as they are turned."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np

from cell.core.documents.record import SCHEMA, HoleRecord, Start, Stop
from cell.core.documents.result import Outcome
from cell.core.errors import DocumentError
from cell.core.observation import Image
from cell.recording import layout
from cell.recording.chain import NOTHING, link, text_hash
from cell.recording.echo import complete_hole, complete_stop, outcomes_of
from cell.recording.forms import form_of, pixel_hash
from cell.recording.rows import Row, damage_explained, read_rows

Record: TypeAlias = Start | HoleRecord | Stop

YEAR_2100 = 4102444800.0  # s since 1970

PRUNED = np.zeros((0, 0), np.uint8)
"""Stands for an image that is not there: its hash is still in the chain."""


@dataclass(frozen=True, eq=False)
class Page:
    """One record of a run and its link of the chain.

    `faults` are sentences on what is not as it was written; `missing` counts images and texts that
    are not there. `record` is None where only parts of it are: a torn end, or a fault.
    """

    record: Record | None
    chain: str
    faults: tuple[str, ...] = ()
    missing: int = 0


def without_images(record: HoleRecord) -> HoleRecord:
    """Keep what a judgement needs of a hole, so that many fit into memory."""
    views = tuple(replace(view, image=PRUNED) for view in record.observation.views)
    return replace(record, observation=replace(record.observation, views=views))


def read_pages(path: Path) -> Iterator[Page]:
    """Turn the pages of a recording: the start, the holes, the stop. Holds two holes at a time.

    What a torn end left of a last hole comes as a page without a record.

    Raises:
        DocumentError: not a recording, damaged, without a whole start, or of a newer format.
    """
    held: Page | None = None
    with damage_explained(path):
        for page in _pages(path):
            if held is not None:
                yield held
            held = page
        if held is None:
            raise DocumentError("holds no whole start record", source=str(path))
        torn = held.missing and isinstance(held.record, HoleRecord)
        yield replace(held, record=None) if torn else held


def _pages(path: Path) -> Iterator[Page]:
    chain = NOTHING
    outcomes: dict[str, Outcome] = {}
    for _, rows in groupby(read_rows(path), _sheaf):
        page = _page(list(rows), chain)
        if isinstance(page.record, HoleRecord):
            outcomes |= outcomes_of(page.record)
        elif isinstance(page.record, Stop):
            page = replace(page, record=complete_stop(page.record, outcomes))
        if chain == NOTHING and (page.missing or not isinstance(page.record, Start)):
            raise DocumentError("holds no whole start record", source=str(path))
        yield page
        chain = page.chain


def _sheaf(row: Row) -> tuple[str, int | None]:
    """Name the record that a row belongs to: it was brought to the disk before the next began."""
    if row.path == layout.STOP.path:
        return "stop", None
    if row.path in (layout.HOLE.path, *layout.IMAGES):
        return "hole", row.number(layout.HOLE_TIMELINE)
    return "start", None


def _page(rows: list[Row], chain: str) -> Page:
    records = [row for row in rows if row.path in READ]
    parts = [row for row in rows if row.path not in READ]
    if len(records) != 1:
        return Page(None, chain, (f"{len(records)} records where one should be",), len(parts))
    place, read = READ[records[0].path]
    plain = records[0].first(place.record)
    stated = records[0].first(place.chain)
    follows = link(chain, plain) == stated
    page = read(plain, parts)
    broken = () if follows else (f"{place.path} does not follow from what stands before it",)
    return replace(page, chain=stated, faults=broken + page.faults)


def _read_start(plain: dict[str, Any], parts: Iterable[Row]) -> Page:
    if plain["schema"] > SCHEMA:
        raise DocumentError(f"is of format {plain['schema']}; this program reads formats up to "
                            f"{SCHEMA}: install a newer one")
    texts = [(row.name, row.first(layout.TEXT)) for row in parts]
    hashes = dict(plain["papers"])
    faults = tuple(f"the paper {name} is altered" for name, text in texts
                   if text_hash(text) != hashes.get(name))
    start = form_of(Start).value(plain)
    _check_moment(start.started)
    missing = len(hashes.keys() - dict(texts).keys())
    papers = {name: dict(texts).get(name, "") for name in hashes}
    return Page(replace(start, papers=papers), "", faults, missing)


def _read_hole(plain: dict[str, Any], parts: Iterable[Row]) -> Page:
    """Every view has its image, under its own light, and there is no image beside them."""
    views, hole_id = plain["observation"]["views"], plain["observation"]["hole_id"]
    expected = Counter((f"{layout.CAMERA}/{view['light']}", view["image"]) for view in views)
    found: Counter[tuple[str, str]] = Counter()
    images, faults = {}, []
    for row in parts:
        name = row.first(layout.PIXELS)
        images[name] = _decode(row)
        found[row.path, name] += 1
        if pixel_hash(images[name]) != name:
            faults.append(f"an image of hole {hole_id} is altered")
    faults += [f"an image of hole {hole_id} does not belong at {path}"
               for path, _ in found - expected]
    for view in views:
        view["image"] = images.get(view["image"], PRUNED)
    return Page(complete_hole(form_of(HoleRecord).value(plain)), "", tuple(faults),
                (expected - found).total())


def _read_stop(plain: dict[str, Any], parts: Iterable[Row]) -> Page:
    stop = form_of(Stop).value(plain)
    _check_moment(stop.finished)
    return Page(stop, "", tuple(f"{row.path} is unexpected" for row in parts))


def _check_moment(seconds: float) -> None:
    if not 0.0 <= seconds < YEAR_2100:
        raise DocumentError(f"is damaged: {seconds} seconds since 1970 is no date of a run")


def _decode(row: Row) -> Image:
    """Decode an image; what does not decode is as good as altered."""
    blob = row.blob(layout.PNG)
    image = None if blob is None else cv2.imdecode(blob, cv2.IMREAD_UNCHANGED)
    return PRUNED if image is None else image


READ: dict[str, tuple[layout.Place, Callable[[dict[str, Any], Iterable[Row]], Page]]] = {
    layout.START.path: (layout.START, _read_start),
    layout.HOLE.path: (layout.HOLE, _read_hole),
    layout.STOP.path: (layout.STOP, _read_stop),
}
