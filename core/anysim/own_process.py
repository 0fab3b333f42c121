"""Python modules run in a process of their own, with a time limit, so that a crash or a hang is a sentence here."""

import signal
import subprocess
import sys
from typing import NamedTuple


class Ended(NamedTuple):
    """What a process printed, and `trouble`: how it ended, in words, or empty where it ended well."""

    out: str
    err: str
    trouble: str


def run_module(module: str, *arguments: str, limit: float) -> Ended:
    """Run `python -m module arguments` for at most `limit` seconds; what it printed until then comes back."""
    command = (sys.executable, "-m", module, *arguments)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            out, err = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            return Ended(out, err, f"took longer than {limit:g} s and was stopped")
        except BaseException:
            process.kill()
            raise
    return Ended(out, err, how_it_ended(process.returncode))


def how_it_ended(code: int) -> str:
    """Words for an exit code, below 0 for a signal; empty for 0."""
    if code >= 0:
        return f"ended with exit code {code}" if code else ""
    name = signal.Signals(-code).name if -code in set(signal.Signals) else "unknown"
    return f"was ended by signal {-code} ({name})"
