"""Exceptions of headrace. Each states the file that caused it and the place in that file, if known."""

from __future__ import annotations

from typing import Optional


class HeadraceError(Exception):
    """Base class of all errors of headrace. The message says what failed and why.

    ``file`` is the file that caused the error, ``place`` the place in that file (``"byte 1024"``, ``"line 7, target_m"``). Each is
    None if unknown.
    """

    def __init__(self, message: str, file: Optional[str] = None, place: Optional[str] = None) -> None:
        super().__init__(message, file, place)
        self.message = message
        self.file = file
        self.place = place

    def __str__(self) -> str:
        return self.message


class LogError(HeadraceError):
    """A log can't be read as a whole. Damage within a log isn't an error: see ``Log.losses``."""


class ConfigError(HeadraceError):
    """A vehicle file can't be read, or has wrong keys. The message lists all of them; file and place are those of the first."""


class ReplayError(HeadraceError):
    """A dive can't be replayed: it has no vehicle file, or no filter for smoothing, or the loop can't be armed."""


class SamplingError(HeadraceError, ValueError):
    """The sampling equations have no solution: an argument is out of range, or no speed meets the target."""
