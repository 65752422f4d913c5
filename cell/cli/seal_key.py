"""`cell seal-key`: the key that recordings are sealed with."""

from __future__ import annotations

import typer

from cell.cli.words import answers, print_json

seal_key_app = typer.Typer(
    name="seal-key", no_args_is_help=True,
    help="""The key that recordings are sealed with (Ed25519).

Recordings are *tamper-evident*: with a key, only who holds it can seal, so an edited recording
cannot get a fitting seal again; without one a seal is made of hashes only. It does not protect
against someone who holds both the key and the disk.

The private key lies in `~/.config/cell/seal.key`, or where `CELL_SEAL_KEY` says, never in `logs/`.
Give the public half (`.pub`) to the auditor: `cell audit LOG --key FILE`.""")

JSON = typer.Option(False, "--json", help="Print one JSON object.")


@seal_key_app.command("new")
def new(as_json: bool = JSON) -> None:
    """Make a key where none is; the bodies from now on are signed with it."""
    from cell.recording.keys import key_path, new_key

    new_key(key_path())
    _show(as_json)


@seal_key_app.command("show")
def show(as_json: bool = JSON) -> None:
    """Show the public half of the key and its id, which every signed seal names."""
    _show(as_json)


def _show(as_json: bool) -> None:
    from cell.core.errors import DocumentError
    from cell.recording.keys import key_id, key_path, public_path, public_text, read_key

    path = key_path()
    key = read_key(path)
    if key is None:
        raise DocumentError("there is no key: seals are made of hashes only. "
                            "Make one with: cell seal-key new", source=str(path))
    public = key.public_key()
    if as_json:
        print_json({"id": key_id(public), "public_key": public_text(public), "path": str(path),
                    "public_path": str(public_path(path))})
    else:
        answers.print(f"key    {key_id(public)}\npath   {path}\n\n{public_text(public)}",
                      highlight=False, soft_wrap=True)
