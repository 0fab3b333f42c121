"""foxglove.ImageAnnotations of annotators' records, by their keys: boxes, skeletons, trails and points."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from anysim.record.header import StreamInfo
from anysim.record.streams import StreamRow
from anysim_mcap.foxglove.parts import color, stamp
from anysim_mcap.stream_messages import nanoseconds

COLORS = ((0.9, 0.2, 0.2), (0.2, 0.7, 0.2), (0.3, 0.5, 1.0), (0.9, 0.7, 0.1), (0.8, 0.3, 0.9), (0.1, 0.8, 0.8))
EDGES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7))
"""Between corners of a box, whose order is x, then y, then z from low to high, z fastest."""
OF_THE_FIRST_STEP = ("obj_bbox", "nav_point")
"""Annotators of segments whose pixels are those of the segment's first step."""
KEYS = ("box", "pixels", "pixel")
"""Records with one of them are drawn."""


def has_marks(info: StreamInfo) -> bool:
    """Whether the records of a stream can be drawn."""
    keys = info.about.get("records")
    return info.kind == "data" and isinstance(keys, Mapping) and any(key in keys for key in KEYS)


def marks(rows: Iterable[StreamRow], info: StreamInfo, times: Sequence[float]) -> Iterator[tuple[int, bytes]]:
    """Messages of a stream's rows with their control steps, in order; `times` [s] are those of all steps."""
    found: dict[int, list[Any]] = {}
    for row in rows:
        records = [record for record in row.value if isinstance(record, Mapping)]
        if info.about.get("annotator") in OF_THE_FIRST_STEP:
            for record in records:
                found.setdefault(int(record["first_step"]), []).append(record)
        else:
            found.setdefault(row.step, []).extend(records)
    for step in sorted(found):
        yield step, _message(found[step], nanoseconds(times[step])).SerializeToString(deterministic=True)


def _message(records: Sequence[Mapping[str, Any]], time: int) -> Any:
    from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations

    message = ImageAnnotations(timestamp=stamp(time))
    for i, record in enumerate(records):
        number = record.get("id", i)
        _draw(message, record, color(COLORS[(number if isinstance(number, int) else i) % len(COLORS)]))
    return message


def _draw(message: Any, record: Mapping[str, Any], shade: Any) -> None:
    from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation as Points

    box, pixels, pixel = (record.get(key) for key in KEYS)
    label = str(record.get("name") or record.get("robot") or record.get("tool") or record.get("target") or "")
    if box is not None:
        left, top, right, bottom = box
        _add_points(message, Points.LINE_LOOP, [(left, top), (right, top), (right, bottom), (left, bottom)], shade)
        _add_text(message, (left, top), label, shade)
    elif pixels is not None:
        parents = record.get("parents")
        pairs = EDGES if parents is None else [(k, parent) for k, parent in enumerate(parents) if parent >= 0]
        lines = [(pixels[a], pixels[b]) for a, b in pairs if _seen(pixels[a]) and _seen(pixels[b])]
        _add_points(message, Points.LINE_LIST, [point for line in lines for point in line], shade)
        seen = [point for point in pixels if _seen(point)]
        if parents is not None:
            _add_points(message, Points.POINTS, seen, shade)
        if seen:
            _add_text(message, seen[0], label, shade)
    elif pixel is not None and _seen(pixel):
        trail = [point for point in record.get("trail") or () if _seen(point)]
        _add_points(message, Points.LINE_STRIP, [*trail, pixel], shade)
        circle = message.circles.add(timestamp=message.timestamp, diameter=6.0, thickness=1.0)
        circle.outline_color.CopyFrom(shade)
        circle.position.x, circle.position.y = pixel
        _add_text(message, pixel, label, shade)


def _seen(point: Any) -> bool:
    """Whether a point is before the camera: the others are null."""
    return isinstance(point, Sequence) and len(point) == 2 and None not in point


def _add_points(message: Any, kind: Any, points: Sequence[Any], shade: Any) -> None:
    if not points:
        return
    added = message.points.add(timestamp=message.timestamp, type=kind, outline_color=shade, thickness=1.0)
    for x, y in points:
        added.points.add(x=x, y=y)


def _add_text(message: Any, at: Any, text: str, shade: Any) -> None:
    if text:
        added = message.texts.add(timestamp=message.timestamp, text=text, font_size=10.0, text_color=shade)
        added.position.x, added.position.y = at
