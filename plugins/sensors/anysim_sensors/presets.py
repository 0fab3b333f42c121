"""Presets of LiDARs and depth cameras, by name: figures of their makers' data sheets, with what is not from there.

They describe what rays are cast. Noise, dropouts and delays are another matter.
"""

from collections.abc import Callable, Mapping
from math import radians
from typing import NamedTuple, TypeVar

from anysim.errors import AnysimError, listing, suggest
from anysim_sensors.patterns import Pattern, planar, rosette, spinning, wound


class LidarPreset(NamedTuple):
    """A LiDAR.

    Attributes:
        pattern: makes the rays of a scan, by its number; most devices repeat the first.
        rate: scans a second.
        near, far: [m] what is nearer or farther is not measured.
        source: of the figures.
    """

    pattern: Callable[[int], Pattern]
    rate: float
    near: float
    far: float
    source: str


class CameraPreset(NamedTuple):
    """A depth camera; `fov` is vertical [degrees], `near` and `far` along the optical axis [m]."""

    width: int
    height: int
    fov: float
    rate: float
    near: float
    far: float
    source: str


LIDARS: Mapping[str, LidarPreset] = {
    "vlp_16": LidarPreset(
        lambda scan: spinning([radians(2 * i - 15) for i in range(16)], 1800, 10.0),
        10.0, 0.5, 100.0,
        "Velodyne VLP-16 user manual: 16 channels from -15 to 15 degrees, 0.2 degrees of azimuth at 10 Hz, 100 m. "
        "The beams of a column share one moment; the device fires them 2.3 us apart.",
    ),
    "mid_360": LidarPreset(
        lambda scan: wound(20_000, 10.0, radians(-7), radians(52), scan=scan),
        10.0, 0.1, 40.0,
        "Livox Mid-360 user manual: 360 by -7 to 52 degrees, 200,000 points/s, 10 Hz, from 0.1 m, 40 m at 10 % "
        "reflectivity. The curve is ours: it never repeats, as the device's, whose own is not published there.",
    ),
    "mid_40": LidarPreset(
        lambda scan: rosette(10_000, 10.0, radians(19.2), scan=scan),
        10.0, 1.0, 90.0,
        "Livox Mid-40 user manual: a circle of 38.4 degrees, 100,000 points/s, 90 m at 10 % reflectivity. The rosette "
        "is that of two prisms; its speeds are ours.",
    ),
    "utm_30lx": LidarPreset(
        lambda scan: planar(1081, 40.0, radians(270)),
        40.0, 0.1, 30.0,
        "Hokuyo UTM-30LX data sheet: 270 degrees in steps of 0.25, 25 ms a scan, 0.1 to 30 m.",
    ),
}  # fmt: skip

CAMERAS: Mapping[str, CameraPreset] = {
    "d435": CameraPreset(
        848, 480, 58.0, 30.0, 0.28, 10.0,
        "Intel RealSense D435 data sheet: 87 by 58 degrees, up to 10 m, from 0.28 m; 848 by 480 at 30 Hz is one of its "
        "modes. Square pixels make the horizontal field 88.8 degrees.",
    ),
    "kinect_v2": CameraPreset(
        512, 424, 60.0, 30.0, 0.5, 4.5,
        "Microsoft Kinect for Windows v2: 512 by 424, 70 by 60 degrees, 0.5 to 4.5 m, 30 Hz.",
    ),
}  # fmt: skip


def lidar_preset(name: str) -> LidarPreset:
    """A LiDAR by name.

    Raises:
        AnysimError: there is none; lists those that are.
    """
    return _one("LiDAR", name, LIDARS)


def camera_preset(name: str) -> CameraPreset:
    """A depth camera by name; raises AnysimError as `lidar_preset`."""
    return _one("depth camera", name, CAMERAS)


T = TypeVar("T")


def _one(kind: str, name: str, presets: Mapping[str, T]) -> T:
    if name not in presets:
        raise AnysimError(
            f"there is no preset of a {kind} '{name}'{suggest(name, list(presets))} (presets: {listing(presets)})"
        )
    return presets[name]
