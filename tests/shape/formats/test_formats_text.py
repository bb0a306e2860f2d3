"""Text of any encoding and line end, and the numbers of many lines at once."""

from __future__ import annotations

import numpy as np
import pytest

from resfit.errors import InputError
from resfit.shape.formats import text
from resfit.shape.formats.text import TextLines, decode_name, parse_numbers, plain_text

PLAIN = "# größe\nv 1 2 3\nv 4 5 6\n"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("mark", "encoding"),
    [
        (b"", "utf-8"),
        (b"\xef\xbb\xbf", "utf-8"),
        (b"\xff\xfe", "utf-16-le"),
        (b"\xfe\xff", "utf-16-be"),
        (b"", "utf-16-le"),
        (b"", "utf-16-be"),
    ],
)
def test_every_encoding_and_line_end_is_the_same_text(mark: bytes, encoding: str, end: str) -> None:
    assert plain_text(mark + PLAIN.replace("\n", end).encode(encoding)).decode() == PLAIN


@pytest.mark.parametrize("data", [b"", b"x", b"v 1", b"\x00\x01\x02\x03\x00\x00\x00\x08", b"g \xe4\n"])
def test_other_bytes_stay_as_they_are(data: bytes) -> None:
    assert plain_text(data) == (data if data.endswith(b"\n") else data + b"\n")


def test_names_are_utf_8_or_latin_1() -> None:
    assert decode_name("Tür".encode()) == decode_name("Tür".encode("latin-1")) == "Tür"


@pytest.mark.parametrize("block", [1, 2, 1000])
def test_numbers_of_chosen_lines(monkeypatch: pytest.MonkeyPatch, block: int) -> None:
    monkeypatch.setattr(text, "BLOCK", block)
    lines = TextLines(b"v 1 2\n# no number\nv -3.5e2\t4 5\nx y\nv\nv 6 \v 7\n", "'a'")
    numbers = lines.numbers(np.array([0, 2, 4, 5]), keyword=1)
    assert numbers.values.tolist() == [1, 2, -350, 4, 5, 6, 7]
    assert numbers.counts.tolist() == [2, 3, 0, 2] and numbers.first.tolist() == [0, 2, 5, 5]
    assert lines.numbers(np.zeros(0, np.int64)).values.tolist() == []
    # The last line is two of the file, joined.
    assert [lines.number(index) for index in (0, 5)] == [1, 6]


def test_only_the_first_number_before_slashes_counts() -> None:
    lines = TextLines(b"f 1/2/3 -4//5 6/7 8\n", "'a'")
    assert lines.numbers(np.array([0]), np.int64, keyword=1, slashes=True).values.tolist() == [1, -4, 6, 8]


@pytest.mark.parametrize("bad", ["x", "1,5", "1.2.3", "0x10", "1_0", "\x00", "--1", "1d5", "1-2"])
def test_what_is_no_number_is_named_with_its_line(bad: str) -> None:
    rows = ["1 2 3\n"] * 99
    rows[41] = f"1 2 3 {bad}\n"
    with pytest.raises(InputError, match=r"line 42 of 'a' holds '.*'.*\.$") as caught:
        TextLines("".join(rows).encode(), "'a'").numbers(np.arange(99))
    assert bad.replace("\x00", "?") in str(caught.value)
    assert ("decimal point" in str(caught.value)) == (bad == "1,5")


def test_numbers_are_read_as_written() -> None:
    values = np.array([0.1, 1e-300, 1.7976931348623157e308, -2.5e-7, 123456789.123456789])
    assert np.array_equal(parse_numbers(" ".join(map(repr, values.tolist())).encode(), 5), values)
    assert parse_numbers(b"1 2", 3) is None
