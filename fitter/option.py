"""The entry of an option in the table of options: its help, its legal values, its flags, and where it has no effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from numbers import Integral
from typing import Any

from resfit.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Interval:
    """An interval of numbers, closed or open at either end."""

    least: float | None = None
    above: float | None = None
    most: float | None = None
    below: float | None = None
    whole: bool = False
    """True if only whole numbers are in it."""

    def __contains__(self, value: Any) -> bool:
        """Membership in the interval: True if a value is a number in it; NaN never is."""
        if self.whole and not _is_whole(value):
            return False
        try:
            return (
                value == value
                and (self.least is None or value >= self.least)
                and (self.above is None or value > self.above)
                and (self.most is None or value <= self.most)
                and (self.below is None or value < self.below)
            )
        except TypeError:
            return False

    def __str__(self) -> str:
        return f"a whole number, {self._ends()}" if self.whole else self._ends()

    def _ends(self) -> str:
        if self.least is not None and self.most is not None:
            return f"between {self.least} and {self.most}"
        ends = {"at least": self.least, "above": self.above, "at most": self.most, "below": self.below}
        return " and ".join(f"{word} {end}" for word, end in ends.items() if end is not None)


def _is_whole(value: Any) -> bool:
    """True if a value is an integer of Python or NumPy, and no truth value."""
    return isinstance(value, Integral) and not isinstance(value, bool)


@dataclass(frozen=True)
class Option:
    """Descriptor of an option beside its type and default, which are those of its field."""

    help: str = ""
    """Of the command line and README.md; an option without it is a field of the configuration only."""
    _: KW_ONLY
    name: str = ""
    """Of the field."""
    interval: Interval | None = None
    """Numbers that it may be; None for any value of its type."""
    flags: Mapping[str, Any] = field(default_factory=dict)
    """Flags of the command line that stand for a value, the positive one first; empty if the value is written."""
    rare: bool = False
    """Whether only --help-all shows it."""
    moves: bool = False
    """Whether it has an effect where the parts of an assembly are only moved (objective chamfer)."""
    idle_with: Mapping[str, str] = field(default_factory=dict)
    """Other options, and the value of each that leaves this one without effect."""

    @property
    def public(self) -> bool:
        """True if it is a keyword of `resfit.fit` and an option of the command line."""
        return bool(self.help)

    def spelled(self, value: Any = None) -> str:
        """Its name in messages, where it has a value: as on the command line, if it is there."""
        if not self.public:
            return self.name
        flags = [flag for flag, meant in self.flags.items() if meant == value] or [*self.flags]
        return flags[0] if flags else f"--{self.name.replace('_', '-')}"

    def words(self, value: Any) -> list[str]:
        """The words of a command line that set it; none if no flag stands for the value."""
        if self.flags:
            return [flag for flag, meant in self.flags.items() if meant == value]
        return [self.spelled(), str(value)]

    def check(self, value: Any, choices: tuple[Any, ...] = (), noun: str = "choice") -> None:
        """Refuse a value outside of the interval, or of the choices where there are any, each of which is a `noun`.

        Raises:
            InputError: if so.
        """
        if choices and value not in choices:
            known = ", ".join(map(str, choices))
            raise InputError(f"{self.spelled()} {value}: there is no such {noun}; choose {known}.")
        if self.interval is not None and value not in self.interval:
            raise InputError(f"{self.spelled()} {value} is out of range; it must be {self.interval}.")
