"""Results of a comparison: measures by engine, with the analytic answer where there is one, plots and pictures."""

from collections.abc import Mapping
from typing import NamedTuple

from anysim.conventions import Array


class Measure(NamedTuple):
    """One quantity on several engines.

    Attributes:
        subject: what was measured, such as `bounce: apex`.
        unit: SI unit; empty for a pure number.
        values: by engine; one that could not measure it is not there.
        reference: the analytic answer, or None where there is none.
        tolerance: the largest difference from the reference, or between two engines without one, that counts as
            agreement; None where the number only informs.
        explanation: what accounts for a difference where one is known, in a sentence.
        intervals: by engine, the 95 % confidence interval of a value that was estimated; with them two engines agree
            where theirs overlap.
    """

    subject: str
    unit: str
    values: Mapping[str, float]
    reference: float | None = None
    tolerance: float | None = None
    explanation: str = ""
    intervals: Mapping[str, tuple[float, float]] = {}


class Gap(NamedTuple):
    """A difference between two engines that is no difference of two numbers: the largest over a curve or a set.

    `first` and `second` are engines; `tolerance` and `explanation` are those of a Measure.
    """

    subject: str
    unit: str
    first: str
    second: str
    value: float
    tolerance: float | None = None
    explanation: str = ""


class Series(NamedTuple):
    """A curve of one engine, or of the analytic answer."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


class Plot(NamedTuple):
    """Curves over one abscissa. `reference` is drawn as the analytic answer."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    reference: Series | None = None


class Picture(NamedTuple):
    """An image (H, W, 3) uint8 of one engine."""

    title: str
    engine: str
    pixels: Array


class Layer(NamedTuple):
    """One layer of the comparison.

    Attributes:
        name: asset, kinematics, actuation, contact, camera or task.
        question: what it asks, in a sentence.
        measures: in the order in which a person reads them.
        plots: curves.
        pictures: images.
        refused: engine: why it took no part.
        gaps: differences between pairs of engines beyond the measures.
    """

    name: str
    question: str
    measures: tuple[Measure, ...] = ()
    plots: tuple[Plot, ...] = ()
    pictures: tuple[Picture, ...] = ()
    refused: Mapping[str, str] = {}
    gaps: tuple[Gap, ...] = ()
