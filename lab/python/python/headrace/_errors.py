"""Exceptions of headrace. Each names the file that it is about, and the place in it, where there is one."""

from __future__ import annotations

from typing import Optional


class HeadraceError(Exception):
    """What headrace can't do, and why.

    ``file`` is the file that it is about, ``place`` the place in it (``"byte 1024"``, ``"line 7, target_m"``); None where there is
    none.
    """

    def __init__(self, message: str, file: Optional[str] = None, place: Optional[str] = None) -> None:
        super().__init__(message, file, place)
        self.message = message
        self.file = file
        self.place = place

    def __str__(self) -> str:
        return self.message


class LogError(HeadraceError):
    """A log can't be read as a whole. Damage within one isn't an error: see ``Log.losses``."""


class ConfigError(HeadraceError):
    """A vehicle file can't be read, or keys of it are wrong: all of them in the message, place and file of the first."""


class ReplayError(HeadraceError):
    """A dive can't be replayed: no vehicle file, no filter to smooth with, or the loop can't be armed."""


class SamplingError(HeadraceError, ValueError):
    """Sampling theory has no answer: an argument out of range, or a target that no speed meets."""
