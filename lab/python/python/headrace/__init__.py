"""Coverage of flooded tunnels by profiling sonars: logs of dives, replays, sampling theory, and holes of point clouds.

    >>> import headrace
    >>> log = headrace.Log("dive.mcap")
    >>> log.losses()
    []
    >>> tables = headrace.replay("dive.mcap", target_m=0.3)
    >>> polars.DataFrame(tables.sections)

Names contain the units: ``target_m`` is in metres, ``log_time_ns`` in nanoseconds of the log's clock.
docs/reference/glossary.md explains the terms.
"""

from . import sampling
from ._errors import ConfigError, HeadraceError, LogError, ReplayError, SamplingError
from ._headrace import Log, Loss, Message, Messages, Profile, Source, Table, Tables, __version__, holes, replay

__all__ = [
    "ConfigError",
    "HeadraceError",
    "Log",
    "LogError",
    "Loss",
    "Message",
    "Messages",
    "Profile",
    "ReplayError",
    "SamplingError",
    "Source",
    "Table",
    "Tables",
    "__version__",
    "holes",
    "replay",
    "sampling",
]
