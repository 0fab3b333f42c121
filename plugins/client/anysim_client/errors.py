"""Errors of the service: typed, with a status for HTTP, and carried to the client as what they are."""

from typing import Any

from anysim import errors
from anysim.errors import AnysimError, SpecError, SpecIssue


class ServiceError(AnysimError):
    """The service refuses, or cannot be reached. `status` is that of HTTP."""

    status = 400


class MalformedFrame(ServiceError):
    """A message that is no frame of the protocol."""


class Unauthorized(ServiceError):
    """The token is missing or wrong."""

    status = 401


class ForbiddenSource(ServiceError):
    """Asked under a foreign name or from a foreign web page, or for what is not served."""

    status = 403


class SessionGone(ServiceError):
    """There is no such session, or none any more."""

    status = 404


class SessionTaken(ServiceError):
    """The session is somebody else's, or another connection has it now."""

    status = 409


class LimitExceeded(ServiceError):
    """More than the service gives: envs, sessions, bytes, pixels or time."""

    status = 413


class ServiceBusy(ServiceError):
    """More is waiting than may wait; ask again later."""

    status = 429


class ConnectionLost(ServiceError):
    """The service went away while it was asked; what it has done of that is unknown."""

    status = 503


class TookTooLong(ServiceError):
    """An operation took longer than it may."""

    status = 504


_OWN = {
    kind.__name__: kind
    for kind in (
        ServiceError,
        MalformedFrame,
        Unauthorized,
        ForbiddenSource,
        SessionGone,
        SessionTaken,
        LimitExceeded,
        ServiceBusy,
        ConnectionLost,
        TookTooLong,
    )
}


def status_of(error: BaseException) -> int:
    """The status that HTTP gives an error."""
    if isinstance(error, ServiceError):
        return error.status
    return 500 if isinstance(error, errors.FAILURES) or not isinstance(error, AnysimError) else 422


def to_data(error: BaseException) -> dict[str, Any]:
    """An error as plain data. One that is not anysim's is named and not told: its words may hold paths."""
    status = status_of(error)
    if not isinstance(error, AnysimError):
        words = f"the service failed ({type(error).__name__}); its log has the traceback"
        return {"type": "EngineFailure", "message": words, "status": status}
    kind = next((k.__name__ for k in type(error).__mro__ if k.__name__ in _OWN or hasattr(errors, k.__name__)), "")
    issues = [[issue.where, issue.path, issue.message] for issue in getattr(error, "issues", ())]
    return {"type": kind, "message": str(error), "status": status} | ({"issues": issues} if issues else {})


def from_data(data: Any) -> AnysimError:
    """The error that the service sent; what is not of this form becomes a ServiceError."""
    if not isinstance(data, dict) or not isinstance(data.get("message"), str):
        return ServiceError("the service refused without saying why")
    name, words = str(data.get("type")), data["message"]
    issues = data.get("issues")
    if name == "SpecError" and isinstance(issues, list):
        return SpecError([SpecIssue(*map(str, issue)) for issue in issues])
    kind = _OWN.get(name) or getattr(errors, name, None)
    if isinstance(kind, type) and issubclass(kind, AnysimError):
        return kind(words)
    return ServiceError(words)
