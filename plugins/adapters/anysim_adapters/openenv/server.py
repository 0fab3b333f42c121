"""OpenEnv server on a thread: a service behind the checks of `anysim serve`, that speaks OpenEnv's protocol."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from anysim_adapters.openenv.app import application
from anysim_serving.catalogue import Catalogue
from anysim_serving.server import Service, fresh_token
from anysim_serving.settings import Settings


def openenv_service(source: Any, settings: Settings, **options: Any) -> Service:
    """A service of one task, on a port that is taken at once; `run` or `start` answers on it.

    Args:
        source: an installed task by name, a file, or a mapping.
        settings: where it listens, its token and its limits.
        options: of `Catalogue`, such as `engine` and `overrides`.
    """
    return Service(Catalogue.of([source], limits=settings.limits, **options), settings, make=application)


@contextmanager
def serving_openenv(source: Any, settings: Settings | None = None, **options: Any) -> Iterator[Service]:
    """Such a service on a thread, by default on any port of loopback with a fresh token."""
    service = openenv_service(source, Settings(token=fresh_token()) if settings is None else settings, **options)
    service.start()
    try:
        yield service
    finally:
        service.stop()
