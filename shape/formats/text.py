"""Text files of any encoding and line end, and the numbers of many lines at once."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

BLANK = np.isin(np.arange(256), list(b" \t\n\v\f\r"))
"""Which bytes stand between the words of a line."""
BLOCK = 1 << 15
"""Lines whose numbers are read at once: their bytes fit a processor's cache."""
MARKS = ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))


def plain_text(data: bytes) -> bytes:
    r"""A text file's bytes as UTF-8 whose lines end with `\n`, the last one too.

    UTF-16 is known by its byte order mark, or without one by the zeros of its Latin letters. Other bytes, such as names
    in Latin-1, stay as they are.
    """
    mark, encoding = next((entry for entry in MARKS if data.startswith(entry[0])), (b"", "utf-8"))
    data = data[len(mark) :]
    if not mark:
        even, odd = data[:2000:2].count(0), data[1:2000:2].count(0)
        if max(even, odd) > 20 * min(even, odd) and 2 * max(even, odd) > len(data[1:2000:2]):
            encoding = "utf-16-le" if odd > even else "utf-16-be"
    if encoding != "utf-8":
        data = data.decode(encoding, "replace").encode("utf-8", "replace")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data if data.endswith(b"\n") else data + b"\n"


def decode_name(data: bytes) -> str:
    """A name in UTF-8, or in Latin-1 where it is no UTF-8."""
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def printable(name: str) -> str:
    """The begin of a name as messages show it."""
    return "".join(letter if letter.isprintable() else "?" for letter in name[:30])


def is_whole(values: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Mask of the numbers that are integers that an int64 can hold."""
    return (np.abs(values) < 2.0**53) & (np.floor(values) == values)


@dataclass(frozen=True)
class Numbers:
    """The numbers of lines, one line after the other."""

    values: npt.NDArray
    first: npt.NDArray[np.int64]
    """(n,) index in `values` of each line's first number."""
    counts: npt.NDArray[np.int64]
    """(n,) numbers of each line."""

    def columns(self, count: int) -> npt.NDArray:
        """The first numbers of each line (n, count). Every line must have so many."""
        if len(self.values) == count * len(self.first):
            return self.values.reshape(-1, count)
        return self.values[self.first[:, None] + np.arange(count)]


@dataclass(frozen=True)
class TextLines:
    r"""The lines of a text, as `plain_text` returns it; `\v` stands for a line end that is none."""

    text: bytes
    where: str
    """What messages call the file: its path in quotes."""
    first_line: int = 1
    """Number of the first line in the file."""

    @cached_property
    def raw(self) -> npt.NDArray[np.uint8]:
        """The bytes of the text."""
        return np.frombuffer(self.text, np.uint8)

    @cached_property
    def ends(self) -> npt.NDArray[np.int64]:
        """(n,) index after each line's last byte, which is its line end."""
        return np.flatnonzero(self.raw == ord("\n")) + 1

    @cached_property
    def starts(self) -> npt.NDArray[np.int64]:
        """(n,) index of each line's first byte."""
        return np.concatenate([np.zeros(1, np.int64), self.ends[:-1]])

    @cached_property
    def second(self) -> npt.NDArray[np.uint8]:
        """(n,) the byte after each line's first one; in an empty line that of the next line."""
        return self.raw[np.minimum(self.starts + 1, len(self.raw) - 1)]

    def line(self, index: int | np.integer) -> bytes:
        """One line without its line end."""
        return self.text[self.starts[index] : self.ends[index] - 1]

    def number(self, index: int | np.integer) -> int:
        """The number of a line in the file, from 1 on."""
        return self.first_line + int(index) + self.text.count(b"\v", 0, int(self.starts[index]))

    def name(self, index: int | np.integer) -> str:
        """Name of a line in messages."""
        return f"line {self.number(index)} of {self.where}"

    def numbers(
        self, chosen: npt.NDArray[np.int64], dtype: type = np.float64, keyword: int = 0, slashes: bool = False
    ) -> Numbers:
        """The numbers of some lines.

        Args:
            chosen: (k,) ascending indices of lines.
            dtype: of the numbers.
            keyword: length of the keyword that each line begins with.
            slashes: whether of `1/2/3` only the first number counts.

        Raises:
            InputError: if there is something else in one of them; it names the line.
        """
        blocks = [
            self._block(chosen[low : low + BLOCK], dtype, keyword, slashes)
            for low in range(0, len(chosen), BLOCK)
        ]
        values = np.concatenate([np.zeros(0, dtype), *(values for values, _ in blocks)])
        counts = np.concatenate([np.zeros(0, np.int64), *(counts for _, counts in blocks)])
        return Numbers(values, np.cumsum(counts) - counts, counts)

    def _block(
        self, chosen: npt.NDArray[np.int64], dtype: type, keyword: int, slashes: bool
    ) -> tuple[npt.NDArray, npt.NDArray[np.int64]]:
        """Numbers, and how many are in each line; as in `numbers`."""
        first, last = chosen[0], chosen[-1] + 1
        taken = np.zeros(last - first, bool)
        taken[chosen - first] = True
        lengths = self.ends[first:last] - self.starts[first:last]
        # A copy, in which keywords become blanks.
        words = self.raw[self.starts[first] : self.ends[last - 1]][np.repeat(taken, lengths)]
        bounds = np.cumsum(lengths[taken]) - lengths[taken]
        for letter in range(keyword):
            words[bounds + letter] = ord(" ")
        if slashes:
            _blank_after_slashes(words)
        begins = ~BLANK[words]
        begins[1:] &= BLANK[words[:-1]]
        counts = np.add.reduceat(begins, bounds, dtype=np.int64)
        values = parse_numbers(words.tobytes(), int(counts.sum()), dtype)
        if values is None:
            bad, word = _find_bad_word(words, np.append(bounds, len(words)), dtype)
            raise InputError(f"{self.name(chosen[bad])} holds {_no_number(word, dtype)}.")
        return values, counts


def parse_numbers(words: bytes, count: int, dtype: type = np.float64) -> npt.NDArray | None:
    """The numbers in a text, (count,); None where it holds something else, or another number of them."""
    if not count:
        return np.zeros(0, dtype)
    with warnings.catch_warnings():
        # Before NumPy 2.3 a warning says what is an error now.
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(words, dtype, sep=" ")
        except (DeprecationWarning, ValueError):
            return None
    return values if len(values) == count else None


def _blank_after_slashes(words: np.ndarray) -> None:
    """Overwrite the rest of each word from its first slash on by blanks, but for words that begin with it."""
    marks = np.flatnonzero(BLANK[words] | (words == ord("/")))
    if not len(marks):
        return
    drops = words[marks] == ord("/")
    drops &= ~BLANK[words[marks - 1]]
    words[marks[0] :][np.repeat(drops, np.diff(marks, append=len(words)))] = ord(" ")


def _find_bad_word(words: np.ndarray, bounds: np.ndarray, dtype: type) -> tuple[int, bytes]:
    """The first line with a word that is no number, found by halves, and that word."""

    def parses(part: bytes) -> bool:
        return parse_numbers(part, len(part.split()), dtype) is not None

    low, high = 0, len(bounds) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if parses(words[bounds[low] : bounds[middle]].tobytes()):
            low = middle
        else:
            high = middle
    found = words[bounds[low] : bounds[high]].tobytes().split()
    return low, next((word for word in found if not parses(word)), found[0])


def _no_number(word: bytes, dtype: type) -> str:
    shown = printable(decode_name(word[:20]))
    if dtype is np.float64 and re.fullmatch(rb"[-+]?\d+,\d+", word):
        return f"'{shown}': write numbers with a decimal point, not with a comma"
    kind = "a number" if dtype is np.float64 else "a whole number"
    return f"'{shown}' where {kind} belongs; export the file again"
