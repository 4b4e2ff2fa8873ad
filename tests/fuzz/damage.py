"""Damage to files of any kind: numbers, fields, lines, counts, headers, encodings, lost and repeated parts."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable
from copy import deepcopy
from typing import Any, Final

from tests.fuzz.urdf_texts import Chance

NUMBERS: Final = (
    "", "0", "-0", "-1", "1e400", "-1e400", "1" + "0" * 400, "-1" + "0" * 400, "9" * 5000, "9223372036854775808",
    "-9223372036854775809", "18446744073709551616", "4294967296", "2147483648", "65536", "1e-320", "1e308", "1e155",
    "nan", "-nan", "inf", "-inf", "infinity", ".inf", ".nan", "0x10", "0x1p3", "1_000", "1,5", "1;2", "+5", "5.", ".5",
    "\u0663", "1\u00a0", "1e", "1d3", "--1", "true", "null", "0.1", "3", "1 2",
    "1e6", "0.30000000000000004",
)  # fmt: skip
"""Texts in the place of a number."""
TOKENS: Final = (
    "\0", "\x0b", "\x1b[31m", "\ufeff", "\r", "\r\n", "\n\n", "\t", '"', "'", ",", ",,", ":", "#", "{", "}", "[", "]",
    "&a", "*a", "<<", "!!binary", "---", "...", "%YAML 1.2", "\u2028", "\u202e", "\x85", "é", "🤖", "::error::", "\\",
    "|", ">", "&lt;", "<!-- -->", "${x}", "$(x)", "../", "x" * 3000,
)  # fmt: skip
"""Texts between two characters."""

_NUMBER: Final = re.compile(rb"[-+]?[0-9][0-9.eE+-]*")
_PNG: Final = b"\x89PNG\r\n\x1a\n"


def damaged(data: bytes, chance: Chance) -> bytes:
    """Change a file once to three times."""
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        data = chance.choice(_DAMAGES)(data, chance)
    return data


def _other_number(data: bytes, chance: Chance) -> bytes:
    found = list(_NUMBER.finditer(data[:200_000]))
    if not found:
        return _flipped(data, chance)
    number = chance.choice(found)
    return data[: number.start()] + chance.choice(NUMBERS).encode() + data[number.end() :]


def _token(data: bytes, chance: Chance) -> bytes:
    at = chance.randint(0, len(data))
    return data[:at] + chance.choice(TOKENS).encode() + data[at:]


def _cut_off(data: bytes, chance: Chance) -> bytes:
    return data[: chance.randint(0, len(data))]


def _beheaded(data: bytes, chance: Chance) -> bytes:
    return data[chance.randint(0, min(100, len(data))) :]


def _repeated(data: bytes, chance: Chance) -> bytes:
    start = chance.randint(0, len(data))
    end = min(len(data), start + chance.choice((1, 4, 40, 4000)))
    return data[:end] + data[start:end] * chance.choice((1, 2, 200)) + data[end:]


def _lost(data: bytes, chance: Chance) -> bytes:
    start = chance.randint(0, len(data))
    return data[:start] + data[start + chance.choice((1, 2, 8, 80)) :]


def _flipped(data: bytes, chance: Chance) -> bytes:
    if not data:
        return b"\xff"
    changed = bytearray(data)
    for _ in range(chance.choice((1, 2, 8))):
        changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def _of_lines(change: Callable[[list[bytes], int, int, Chance], None]) -> Callable[[bytes, Chance], bytes]:
    def changed(data: bytes, chance: Chance) -> bytes:
        lines = data.split(b"\n")
        change(lines, chance.randrange(len(lines)), chance.randrange(len(lines)), chance)
        return b"\n".join(lines)

    return changed


def _line_lost(lines: list[bytes], at: int, _to: int, _chance: Chance) -> None:
    del lines[at]


def _line_repeated(lines: list[bytes], at: int, to: int, chance: Chance) -> None:
    lines[to:to] = [lines[at]] * chance.choice((1, 1, 2, 3000))


def _lines_swapped(lines: list[bytes], at: int, to: int, _chance: Chance) -> None:
    lines[at], lines[to] = lines[to], lines[at]


def _field_changed(lines: list[bytes], at: int, _to: int, chance: Chance) -> None:
    """A field of a line is lost, repeated, or another one."""
    mark = b"," if b"," in lines[at] else b" "
    fields = lines[at].split(mark)
    place = chance.randrange(len(fields))
    new = (*NUMBERS, *TOKENS, "time", "x", "linear", "position.a", "time_s")
    fields[place : place + 1] = chance.choice(([], [fields[place]] * 2, [chance.choice(new).encode()]))
    lines[at] = mark.join(fields)


def _encoded(data: bytes, chance: Chance) -> bytes:
    """The file has another encoding, other ends of lines, or a mark at its start."""
    if chance.random() < 0.5:
        return data.replace(b"\n", chance.choice((b"\r\n", b"\r", b"\x0b", "\u2028".encode(), b"\n\n", b"")))
    text = data.decode("utf-8", "replace")
    encoding = chance.choice(("utf-8-sig", "utf-16", "utf-16-le", "utf-32", "latin-1", "cp037", "utf-7"))
    return text.encode(encoding, "replace")


def _count_in_header(data: bytes, chance: Chance) -> bytes:
    """A count of a binary header is another one; the checksum of a PNG is right again."""
    huge = chance.choice((0, 1, 2, 255, 65_535, 2**20, 2**31 - 1, 2**31, 2**32 - 1))
    if data.startswith(_PNG) and len(data) > 33:
        header = bytearray(data[12:29])
        at = chance.choice((4, 8))
        header[at : at + 4] = struct.pack(">I", huge)
        if chance.random() < 0.5:
            header[12 + chance.randrange(5)] = chance.choice((0, 1, 2, 3, 4, 6, 8, 16, 255))
        return data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]
    if len(data) < 84:
        return _flipped(data, chance)
    return data[:80] + struct.pack("<I", huge) + data[84:]


def _coordinate(data: bytes, chance: Chance) -> bytes:
    """A 32-bit number of a binary file is an odd one."""
    if len(data) < 100:
        return _flipped(data, chance)
    at = 84 + 4 * chance.randrange((len(data) - 84) // 4)
    odd = chance.choice((b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff\xff\x7f\x7f", b"\1\0\0\0", b"\1\0\x80\x7f"))
    return data[:at] + odd + data[at + 4 :]


_DAMAGES: Final[tuple[Callable[[bytes, Chance], bytes], ...]] = (
    _other_number, _other_number, _other_number, _other_number, _token, _cut_off, _beheaded, _repeated, _lost, _flipped,
    _of_lines(_line_lost), _of_lines(_line_repeated), _of_lines(_lines_swapped), _of_lines(_field_changed),
    _of_lines(_field_changed), _encoded, _count_in_header, _coordinate,
)  # fmt: skip


ODD_VALUES: Final[tuple[Any, ...]] = (
    None, True, False, 0, -1, 1, 1e308, -1e308, 1e-320, float("inf"), float("nan"), 10**400, -(10**400), 2**63, 2**64,
    "", " ", "x", "1 furlong", "5 kg", "1e999 s", "-1 s", "90 deg", "1 m", "10 Hz", "1e400", "1:30", "nan", "inf", "%",
    "turtlebot3_burgr", "../../x.urdf", "/dev/null", "package://p/x", "ground", "wheel_left_joint", "a\nb", "::error::",
    "\u202e", "🤖", "x" * 5000, [], {}, [[]], [None], {"a": {"b": "c"}}, {"": ""}, ["x"] * 3, {"uniform": [0, 1]},
    {"normal": {"mean": 0, "deviation": 1}}, {"x": 1e400}, [1, 2, 3], [0] * 2000, "no_collision", "upright", "twist",
)  # fmt: skip
"""Values in the place of any value of a scenario."""

Path = tuple[Any, ...]


def places(data: Any, path: Path = ()) -> list[Path]:
    """Return every path in plain data."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [path, *(found for key, value in inner for found in places(value, (*path, key)))]


def at(data: Any, path: Path) -> Any:
    """Return the value at a path."""
    for key in path:
        data = data[key]
    return data


def structure_damaged(data: Any, chance: Chance, words: tuple[str, ...]) -> Any:
    """Change keys, values, units, types or nesting of plain data in place, and return it; `words`: known keys."""
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        paths = [path for path in places(data) if path]
        if not paths:
            return _odd(chance)
        path = chance.choice(paths)
        owner, key = at(data, path[:-1]), path[-1]
        if isinstance(owner, dict) and chance.random() < 0.25:
            _key_damaged(owner, key, chance, words)
        elif chance.random() < 0.15:
            owner[key] = deepcopy(at(data, chance.choice(paths)))
        else:
            _value_damaged(owner, key, chance)
    return data


def _odd(chance: Chance) -> Any:
    """An odd value; a copy, because later damage changes it in place."""
    return deepcopy(chance.choice(ODD_VALUES))


def _key_damaged(owner: dict[Any, Any], key: Any, chance: Chance, words: tuple[str, ...]) -> None:
    match chance.randrange(3):
        case 0:
            del owner[key]
        case 1:
            value = owner.pop(key)
            owner[chance.choice((*words, f"{key}s", str(key)[:-1], str(key).upper(), ""))] = value
        case _:
            owner[chance.choice(words)] = _odd(chance)


_LARGEST = 1e290  # its multiples are floats, too


def _value_damaged(owner: Any, key: Any, chance: Chance) -> None:
    old = owner[key]
    match chance.randrange(7):
        case 0 if isinstance(owner, list):
            del owner[key]
        case 1:
            owner[key] = chance.choice(([old], {str(key): old}, [old, deepcopy(old)], str(old)))
        case 2:
            owner[key] = _nested(old, chance)
        case 3 | 4 if isinstance(old, (int, float)) and not isinstance(old, bool):
            # A text keeps integers that are too large for a float.
            factor = chance.choice((1e9, 1.01))
            scaled = old * factor if abs(old) < _LARGEST else f"{old}0"
            owner[key] = chance.choice((f"{old} m", f"{old} deg", -old, scaled))
        case 5 if isinstance(old, list) and old:
            owner[key] = [deepcopy(each) for _ in range(chance.choice((2, 3, 100))) for each in old]
        case _:
            owner[key] = _odd(chance)


def _nested(value: Any, chance: Chance) -> Any:
    for _ in range(chance.choice((1, 5, 60))):
        value = [value] if chance.random() < 0.5 else {"not": value}
    return value
