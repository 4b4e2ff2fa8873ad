"""A workspace on its way to a worker: an archive of its files, named by a digest of them, and its copy there.

An archive has the files that git sees, and files that scenarios name; without git, all files of the folder.
"""

from __future__ import annotations

import hashlib
import io
import os
import stat
import tarfile
import tempfile
import time
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.git_tree import FileDigests, GitError, GitListing
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line, system_reason
from sim_action.core.workspace import is_of_git

MAX_BYTES: Final = 1 << 30  # the largest size of all files of an archive
_MAX_FILES: Final = 100_000
_LEVEL: Final = 1
_HOUR_NS: Final = 3_600 * 10**9


@dataclass(frozen=True, slots=True)
class Copied:
    """A folder of the caller that workers have a copy of."""

    anchor: Path  # the folder of the caller that the copy stands for; the workspace lies in it, or is it
    root: Path  # the workspace; only its files are in the copy
    digest: str  # the name of the copy

    def holds(self, path: Path) -> bool:
        """Return True if an absolute path is in the workspace."""
        return path.is_relative_to(self.root)

    def moved(self, path: Path, copies: Path) -> Path:
        """Return the path of a file of the caller in the copy; `copies`: the folder of all copies."""
        return copies / self.digest / path.relative_to(self.anchor)


@dataclass(frozen=True, slots=True)
class Archive:
    """The files of a workspace; `data`: a compressed tar file with paths relative to `copied.anchor`."""

    copied: Copied
    data: bytes


def archive_of(
    root: Path, current_folder: Path, named: Iterable[Path] = (), excluded: Collection[Path] = ()
) -> Archive:
    """Return the archive of a workspace.

    Args:
        root: its folder.
        current_folder: the folder which messages name files from.
        named: files to add that git may ignore; those outside the workspace are left out.
        excluded: paths whose untracked files do not count, such as the output folder.

    Raises UsageError if the workspace is too large, or cannot be read.
    """
    anchor = current_folder if root.is_relative_to(current_folder) else root
    paths = {path for path in named if path.is_relative_to(root) and not is_of_git(path.relative_to(root))}
    paths.update(_files(root, excluded))
    buffer, digest, left = io.BytesIO(), hashlib.sha256(anchor.as_posix().encode()), MAX_BYTES
    try:
        with tarfile.open(fileobj=buffer, mode="w:gz", compresslevel=_LEVEL) as tar:
            for path in sorted(paths):
                name = path.relative_to(anchor).as_posix()
                with suppress(FileNotFoundError):
                    member, content = _member(path, name, root)
                    left -= len(content)
                    if left < 0:
                        raise _too_large(root, paths)
                    tar.addfile(member, io.BytesIO(content))
                    described = f"{name}\0{member.mode}\0{member.linkname}\0{len(content)}\0"
                    digest.update(described.encode(errors="surrogateescape") + content)
    except OSError as error:
        raise UsageError(escaped_line(f"the workspace {root} cannot be sent: {_reason(error)}")) from None
    return Archive(Copied(anchor, root, digest.hexdigest()), buffer.getvalue())


def unpack(archive: Archive, copies: Path) -> None:
    """Make the copy of a workspace below a folder, completely or not at all. Raises OSError."""
    target = copies / archive.copied.digest
    if target.exists():
        return
    copies.mkdir(parents=True, exist_ok=True)
    unfinished = Path(tempfile.mkdtemp(dir=copies))
    with tarfile.open(fileobj=io.BytesIO(archive.data), mode="r:gz") as tar:
        # The caller's pickles run here anyway: nothing is gained by distrust of its paths.
        tar.extraction_filter = lambda member, _: member
        tar.extractall(unfinished)  # noqa: S202 - as just said
    (unfinished / archive.copied.root.relative_to(archive.copied.anchor)).mkdir(parents=True, exist_ok=True)
    unfinished.rename(target)


def _member(path: Path, name: str, root: Path) -> tuple[tarfile.TarInfo, bytes]:
    """Return the entry of a file or a link. Raise OSError; FileNotFoundError for anything else."""
    member = tarfile.TarInfo(name)
    status = path.lstat()
    member.mode = stat.S_IMODE(status.st_mode)
    if stat.S_ISLNK(status.st_mode):
        member.type, member.linkname = tarfile.SYMTYPE, _link(path, root)
        return member, b""
    if not stat.S_ISREG(status.st_mode):
        raise FileNotFoundError
    content = path.read_bytes()
    member.size = len(content)
    return member, content


def _link(path: Path, root: Path) -> str:
    """Return the target of a link, relative if it leads into the workspace."""
    target = os.readlink(path)  # noqa: PTH115 - a text
    if Path(target).is_absolute() and Path(target).is_relative_to(root):
        return os.path.relpath(target, path.parent)
    return target


def _files(root: Path, excluded: Collection[Path]) -> Iterator[Path]:
    """Yield the files and links of a workspace, as git sees them if it does."""
    listing = GitListing(root)
    try:
        # Contents do not matter here: a file that has just changed is as good as any other.
        tree = listing.tree(FileDigests(time.time_ns() + _HOUR_NS), excluded)
    except GitError:
        yield from _walked(root, excluded)
    else:
        yield from (root / name for name in tree.contents)
    finally:
        listing.close()


def _walked(root: Path, excluded: Collection[Path]) -> Iterator[Path]:
    count = 0
    for folder, folders, names in os.walk(root):
        place = Path(folder)
        folders[:] = [name for name in folders if not _is_left_out(place / name, excluded)]
        links = [name for name in folders if (place / name).is_symlink()]
        for name in (*links, *names):
            count += 1
            if count > _MAX_FILES:
                raise UsageError(escaped_line(f"the workspace {root} has more than {_MAX_FILES:,} files; {_REMEDY}"))
            if place / name not in excluded:
                yield place / name


_REMEDY: Final = "make it a git repository, so that only its own files are sent to the cluster"


def _is_left_out(folder: Path, excluded: Collection[Path]) -> bool:
    return folder in excluded or folder.name == "__pycache__" or is_of_git(Path(folder.name))


def _too_large(root: Path, paths: Iterable[Path]) -> UsageError:
    sizes: dict[str, int] = {}
    for path in paths:
        with suppress(OSError):
            first = path.relative_to(root).parts[0]
            sizes[first] = sizes.get(first, 0) + path.lstat().st_size
    largest = max(sizes, key=lambda name: sizes[name])
    what = f"the workspace {root} is larger than {MAX_BYTES >> 20} MiB, which is too much for a cluster"
    return UsageError(
        escaped_line(f"{what} ({largest}: {sizes[largest] >> 20} MiB); let .gitignore name what runs do not need")
    )


def _reason(error: OSError) -> str:
    return f"{error.filename}: {system_reason(error)}" if error.filename else system_reason(error)
