"""`anysim openenv` and `anysim openpi` as processes: what they print, whom they answer, and how they end."""

import os
import re
import signal
import subprocess
import sys

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("words", "path", "scheme"),
    [
        (["openenv", "reach", "--max-sessions", "1"], "/ws", "Bearer"),
        (["openpi", "reach", "-p", "zero", "--max-clients", "1"], "", "Api-Key"),
    ],
    ids=["openenv", "openpi"],
)
def test_it_answers_who_has_the_token_and_ends(words: list[str], path: str, scheme: str) -> None:
    command = [sys.executable, "-m", "anysim.cli", *words, "--port", "0", "-e", "mujoco"]
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    environment.pop("ANYSIM_SERVE_TOKEN", None)
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        try:
            lines = ""
            for line in process.stdout:
                lines += line
                if line.startswith("token: "):
                    break
            address = re.search(r"http(://127\.0\.0\.1:\d+)", lines)
            assert address is not None, lines
            url, token = f"ws{address.group(1)}{path}", lines.rpartition("token: ")[2].strip()
            with connect(url, additional_headers={"Authorization": f"{scheme} {token}"}):
                pass
            with pytest.raises(InvalidStatus, match="401"), connect(url):
                pass
            process.send_signal(signal.SIGTERM)
            assert process.stdout.read().endswith("ended: all envs are freed\n")  # after a line of uvicorn on the 401
            assert process.wait(60) == 0
        finally:
            process.kill()
