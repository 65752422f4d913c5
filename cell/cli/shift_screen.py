"""The screen of a shift: readable from three metres, and the one instruction that matters now."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from cell.programs.shift.board import Board, LastBody

COLOURS = {"in_tolerance": "green", "out_of_tolerance": "red", "uncertain": "yellow",
           "incomplete": "magenta"}
STATES = {"ready": "green", "measuring": "cyan", "result": "cyan", "master_due": "yellow",
          "bypass": "yellow", "starting": "white", "stopped": "white"}


def draw(board: Board, draft: str = "") -> RenderableType:
    """Draw one moment of a shift, and what is being typed."""
    colour = STATES.get(board.state, "red")
    title = Text(f" {board.state.replace('_', ' ').upper()} ", style=f"bold reverse {colour}")
    lines: list[RenderableType] = [title, Text(board.instruction, style="bold")]
    if board.detail:
        lines.append(Text(board.detail, style="red"))
    if board.body_id and board.busy:
        lines.append(_body(board))
    lines.append(_strip(board.last))
    lines += [Text(warning, style="bold yellow") for warning in _warnings(board)]
    if draft and board.state != "stopped":
        lines.append(Text(f"> {draft}_", style="bold"))
    return Panel(Group(*lines), title=f"shift {board.shift}", border_style=colour)


def say(board: Board) -> str:
    """Say one moment in a line, for a log or a terminal that is not one."""
    words = [board.state.replace("_", " "), board.body_id if board.busy else "",
             f"hole {board.hole} of {board.holes}" if board.state == "measuring" else "",
             board.detail or board.instruction]
    return "  ".join(word for word in words if word)


def _body(board: Board) -> RenderableType:
    row = Table.grid(padding=(0, 2))
    words = f"body {board.body_id}, type {board.body_type}" + ("  TRIAL" if board.trial else "")
    row.add_row(words, ProgressBar(total=max(board.holes, 1), completed=board.hole, width=30),
                f"hole {board.hole} of {board.holes}",
                f"{board.seconds_left} s left" if board.seconds_left else "")
    return row


def _strip(last: tuple[LastBody, ...]) -> RenderableType:
    strip = Text()
    for body in last:
        strip.append("■ ", style=COLOURS.get(body.verdict, "white"))
    if last:
        newest = last[-1]
        strip.append(f" {newest.body_id}: {newest.verdict.replace('_', ' ')}"
                     + (" (trial)" if newest.trial else ""))
    return strip


def _warnings(board: Board) -> list[str]:
    return [words for words, on in (
        (f"BYPASS: {board.bypass}", board.bypass),
        ("the PLC's heartbeat has stopped", not board.line_alive),
        (f"the database is behind: {board.trouble}", board.trouble)) if on]
