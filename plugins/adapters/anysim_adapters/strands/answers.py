"""Answers in the form of agents' tools: a status, and content of words, data and images."""

from collections.abc import Callable, Mapping
from functools import wraps
from io import BytesIO
from typing import Any, TypeVar

from anysim.conventions import Array
from anysim.errors import AnysimError, CapabilityError

Answer = dict[str, Any]
"""`{"status": "success" | "error", "content": [{"text": …}, {"json": …}, {"image": …}]}`."""
F = TypeVar("F", bound=Callable[..., Answer])


def success(text: str, data: Mapping[str, Any] | None = None, image: Array | None = None) -> Answer:
    """What went well, in words, with data and an image (H, W, 3) uint8 where there are any."""
    content: list[dict[str, Any]] = [{"text": text}]
    if data is not None:
        content.append({"json": dict(data)})
    if image is not None:
        content.append({"image": {"format": "png", "source": {"bytes": _png(image)}}})
    return {"status": "success", "content": content}


def error(text: str, data: Mapping[str, Any] | None = None) -> Answer:
    """What was refused or failed, in words, with data where there are any."""
    return {"status": "error", "content": [{"text": text}] if data is None else [{"text": text}, {"json": dict(data)}]}


def answering(method: F) -> F:
    """The method with its errors as answers: an agent's tool never raises."""

    @wraps(method)
    def answer(*args: Any, **keywords: Any) -> Answer:
        try:
            return method(*args, **keywords)
        except CapabilityError as refused:
            return error(f"{method.__name__}: {refused}", {"code": "unsupported_by_backend"})
        except AnysimError as failed:
            return error(f"{method.__name__}: {failed}")

    return answer  # pyright: ignore[reportReturnType]


def _png(image: Array) -> bytes:
    from PIL import Image

    file = BytesIO()
    Image.fromarray(image).save(file, "PNG")
    return file.getvalue()
