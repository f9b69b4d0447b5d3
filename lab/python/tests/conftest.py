import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def golden() -> Path:
    """The golden logs of the program's own tests."""
    return ROOT / "tests" / "golden"


@pytest.fixture(scope="session")
def program() -> Path:
    """The headrace program: HEADRACE_BIN, or the latest build."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    places = [os.environ.get("HEADRACE_BIN"), target / "release" / "headrace", target / "debug" / "headrace"]
    found = [Path(place) for place in places if place and Path(place).is_file()]
    if not found:
        pytest.skip("skipped: the headrace program isn't built; set HEADRACE_BIN")
    subprocess.run([found[0], "--version"], check=True, capture_output=True)
    return found[0]
