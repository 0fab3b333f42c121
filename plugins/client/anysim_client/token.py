"""Token of a service, kept for the other programs of the user who runs it."""

import hmac
import json
import os
import stat
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

TOKEN_ENV = "ANYSIM_SERVE_TOKEN"
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def token_file(address: str) -> Path:
    """Where the token of a service on this machine is kept, by its port."""
    from platformdirs import user_state_dir

    folder = os.environ.get("ANYSIM_STATE_DIR") or user_state_dir("anysim", appauthor=False)
    return Path(folder) / "services" / f"{urlsplit(address).port}.json"


def keep_token(address: str, token: str) -> Path:
    """Write the token for clients of the same user: a file that nobody else can read, whole or not there."""
    path = token_file(address)
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    path.parent.chmod(0o700)
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.unlink(missing_ok=True)
    descriptor = os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), 0o600)
    with os.fdopen(descriptor, "w") as file:
        json.dump({"address": address, "token": token, "process": os.getpid()}, file)
    aside.replace(path)
    return path


def forget_token(path: Path, token: str) -> None:
    """Remove the file, unless a later service has written its own."""
    if (kept := _read(path)) is not None and hmac.compare_digest(str(kept.get("token")), token):
        path.unlink(missing_ok=True)


def kept_token(address: str) -> str:
    """The token that a service of this user on this machine keeps for its clients; empty if there is none.

    It is read from a file that is this user's and nobody else's, and for loopback alone: no other machine is sent it.
    """
    parts = urlsplit(address)
    if parts.hostname not in LOOPBACK:
        return ""
    kept = _read(token_file(address))
    if kept is None or urlsplit(str(kept.get("address"))).port != parts.port:
        return ""
    return str(kept.get("token", ""))


def _read(path: Path) -> dict[str, Any] | None:
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    except OSError:
        return None
    with os.fdopen(descriptor) as file:
        about = os.fstat(descriptor)
        private = stat.S_ISREG(about.st_mode) and about.st_uid == os.getuid() and not about.st_mode & 0o077
        try:
            found = json.loads(file.read(65536)) if private else None
        except ValueError:
            return None
    return found if isinstance(found, dict) else None
