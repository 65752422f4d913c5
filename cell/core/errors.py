"""The errors of the application, and the exit code that each ends with.

    Exception
    ├── CellError                  something the user can act on; caught once, in `cli`
    │   ├── DocumentError      2   a document, recording or argument is wrong: nothing has moved
    │   ├── DeviceError        3   robot, camera or lights failed: nothing moves again
    │   └── RecordingError     4   the recording could not be written
    └── UnmeasurableError          a pair of images that carries no measurement; caught once, in
                                   `measure_hole`, and turned into the result `NotMeasured`

Everything else is a bug and ends with 70, never with a code that could be read as a verdict.
"""

IN_TOLERANCE, OUT_OF_TOLERANCE = 0, 1
BUG, INTERRUPTED = 70, 130


class CellError(Exception):
    """A failure that the user can act on. `str()` is one or more sentences for them."""

    exit_code = BUG


class DocumentError(CellError):
    """Refuse a document: says where (`source`), which key or row, what was expected, what came."""

    exit_code = 2

    def __init__(self, message: str, *, source: str | None = None,
                 place: str | None = None) -> None:
        self.source, self.place, self.message = source, place, message
        super().__init__(": ".join(part for part in (source, place, message) if part))


class DeviceError(CellError):
    """Report a device that is absent, failed or answered nonsense. `device` names it."""

    exit_code = 3

    def __init__(self, message: str, *, device: str | None = None) -> None:
        self.device, self.message = device, message
        super().__init__(f"{device}: {message}" if device else message)


class RecordingError(CellError):
    """Report that a recording, its seal or its report could not be written."""

    exit_code = 4


class UnmeasurableError(Exception):
    """Refuse a measurement with a short documented `reason` and a sentence of `detail`."""

    def __init__(self, reason: str, detail: str) -> None:
        self.reason, self.detail = reason, detail
        super().__init__(f"{reason}: {detail}")
