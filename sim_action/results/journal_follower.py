"""Follow the journal of a call while it grows: each look reads only what is new."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final

from pydantic import ValidationError

from sim_action.core.files import open_regular
from sim_action.core.wording import escaped_line, system_reason
from sim_action.results.journal import (
    JOURNAL_FILE,
    MAX_LINE_BYTES,
    MAX_RECORDS,
    Recorded,
    header_problem,
    parsed_record,
)
from sim_action.results.journal_records import Header

# One look at a large journal is an answer to a request, so it must end soon.
_MAX_BYTES_OF_LOOK: Final = 16_000_000
# Another call may get the same inode; the end of what was read differs, because its lines have times.
_COMPARED_BYTES: Final = 512


class JournalFollower:
    """The journal of a folder, which may begin later, grow, be removed, and be replaced by that of another call.

    Attributes:
        recorded: what was read; None: there is no valid journal.
        problem: the reason why the journal cannot be read; empty if it can, and if there is none.
        call: the number of journals that were found until now.
        has_more: True if the last look has left something unread.
        written_at: the time of the last change in s since the epoch.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder.absolute() / JOURNAL_FILE
        self.recorded: Recorded | None = None
        self.problem = ""
        self.call = 0
        self.has_more = False
        self.written_at = 0.0
        self._file: tuple[int, int] | None = None
        self._offset = 0
        self._end = b""

    @property
    def is_over(self) -> bool:
        """True if the call has ended."""
        return self.recorded is not None and any(record.event == "ended" for record in self.recorded.records[-1:])

    @property
    def elapsed(self) -> float:
        """The wall time in s since the start of the call; of one that has ended, until its end."""
        if self.recorded is None:
            return 0.0
        last = max((record.at for record in self.recorded.records), default=0.0)
        return last if self.is_over else last + max(0.0, time.time() - self.written_at)

    def look(self) -> None:
        """Read the new lines, up to a size."""
        self.has_more, self.problem = False, ""
        try:
            with open_regular(self._path, follow_link=False) as file:
                self._continue(file)
        except FileNotFoundError:
            self._forget()
        except OSError as error:
            self._forget()
            self.problem = escaped_line(f"{JOURNAL_FILE} cannot be read: {system_reason(error)}")
        except ValidationError as error:
            self._forget()
            self.problem = escaped_line(f"{JOURNAL_FILE} is not a valid journal: {header_problem(error)}")

    def _forget(self) -> None:
        self.recorded, self._file, self._offset, self._end = None, None, 0, b""

    def _continue(self, file: BinaryIO) -> None:
        """Read further lines. Raise OSError, and ValidationError if the first line is no header."""
        status = os.fstat(file.fileno())
        found = (status.st_dev, status.st_ino)
        self.written_at = status.st_mtime
        file.seek(self._offset - len(self._end))
        if found != self._file or file.read(len(self._end)) != self._end:
            self._forget()
            self._file = found
            file.seek(0)
        limit = self._offset + _MAX_BYTES_OF_LOOK
        while self._offset < limit:
            line = file.readline(MAX_LINE_BYTES)
            if not line.endswith(b"\n") and len(line) < MAX_LINE_BYTES:
                # The end of the file, or a line of which the rest will follow.
                return
            self._add(line)
            self._offset += len(line)
            self._end = (self._end + line[-_COMPARED_BYTES:])[-_COMPARED_BYTES:]
        self.has_more = True

    def _add(self, line: bytes) -> None:
        """Add a line. Raise ValidationError if the first line is no header."""
        if self.recorded is None:
            self.recorded = Recorded(Header.model_validate_json(line))
            self.call += 1
        elif len(self.recorded.records) < MAX_RECORDS:
            with suppress(ValueError):
                self.recorded.add(parsed_record(line))
