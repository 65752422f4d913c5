"""What an audit is asked: does it reproduce, or what if something else had been known?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from cell.core.documents.papers import Papers
from cell.core.documents.record import Start


@dataclass(frozen=True)
class WhatIf:
    """Other documents (by name, as `Start.papers` has them) or another method than recorded."""

    texts: Mapping[str, str] = field(default_factory=dict)
    method: str | None = None

    @property
    def asks(self) -> bool:
        """Whether anything differs from what was recorded."""
        return bool(self.texts) or self.method is not None


@dataclass(frozen=True)
class Question:
    """How an audit goes about: picklable, so that it can travel to other processes.

    `unsealed` accepts a file without a fitting seal; `trusted` are the ids of keys one
    of which must have signed; `what_if` asks for other numbers instead of the
    recorded ones; `save` draws both results where they differ.
    """

    unsealed: bool = False
    trusted: tuple[str, ...] = ()
    what_if: WhatIf = WhatIf()
    save: bool = False

    def papers(self, start: Start) -> Papers:
        """Parse the papers to recompute with: the recorded ones, with those of the what-if.

        Raises:
            DocumentError: they do not belong together.
        """
        papers = Papers.parse({**start.papers, **self.what_if.texts}, start.set_id)
        if self.what_if.method is None:
            return papers
        return replace(papers, job=papers.job.model_copy(update={"method": self.what_if.method}))
