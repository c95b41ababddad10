# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line in a process of its own."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "physics", *map(str, arguments)], cwd=ROOT, capture_output=True, text=True, check=False
    )
