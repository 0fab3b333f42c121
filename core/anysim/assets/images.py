"""Images of assets, whose size is known before a pixel is decoded."""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from anysim.assets.mesh_budget import bounded, check
from anysim.errors import AssetError
from anysim_schemas.limits import IMAGE_BYTES, IMAGE_PIXELS, Limit

_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM", "GIF", "WEBP", "TGA")
"""Others run programs (EPS) or have parsers without maintainers."""


@contextmanager
def opened_image(path: Path, limit: Limit = IMAGE_PIXELS) -> Iterator[Any]:
    """An image (`PIL.Image.Image`) of at most `limit` pixels, not decoded yet.

    Raises:
        AssetError: no plain file, too large, or no image; also for what decoding in the `with` block raises.
    """
    from PIL import Image

    data = bounded(path, IMAGE_BYTES)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(io.BytesIO(data), formats=_FORMATS)
        with image:
            check(path, limit, image.width * image.height)
            yield image
    except AssetError:
        raise
    except Image.DecompressionBombError as error:
        raise AssetError(f"{path}: {limit.sentence()}") from error
    except Exception as error:  # decoders of eight formats raise what they like
        raise AssetError(
            f"{path}: cannot be read as an image ({type(error).__name__}); expected PNG, JPEG, TIFF or BMP"
        ) from error
