"""Policy server: openpi's protocol behind the checks of `anysim serve`."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from anysim_adapters.openpi.app import application
from anysim_adapters.openpi.host import PolicyHost
from anysim_serving.catalogue import Catalogue
from anysim_serving.server import Service, fresh_token
from anysim_serving.settings import Settings


def policy_service(host: PolicyHost, settings: Settings) -> Service:
    """A service of a policy, on a port that is taken at once; `run` or `start` answers on it.

    Its sessions are those of the host; of the limits those of messages hold.
    """
    return Service(Catalogue({}), settings, make=lambda *_: application(host))


@contextmanager
def serving_policy(task: Any, policy: str, settings: Settings | None = None, **options: Any) -> Iterator[Service]:
    """Such a service on a thread, by default on any port of loopback with a fresh token.

    Args:
        task: whose observations and actions the policy has.
        policy: as `anysim evaluate --policy` names it.
        settings: how it is run.
        options: of `PolicyHost`.
    """
    with PolicyHost(task, policy, **options) as host:
        service = policy_service(host, Settings(token=fresh_token()) if settings is None else settings)
        service.start()
        try:
            yield service
        finally:
            service.stop()
