"""Changes of the keys of `world.sensors` and of what is recorded of them."""

from tests.schemas.keys.row import Row, row
from tests.schemas.keys.world import ARM


def sensed(change: str, keys: str = "", of: str = "s", *given: str) -> Row:
    """A change of a sensor that tracks a ball, which a term reads."""
    return row(
        f"world.sensors.s.{change}",
        given=(
            *given,
            f"world.sensors.s={{sensor: tracking, frame: ball{keys}}}",
            f"task.observations.policy=[{{term: sensor, of: {of}}}]",
        ),
        seen="episode",
    )


def noisy(change: str, keys: str) -> Row:
    """A change of the noise of its position."""
    return sensed(f"noise.position.{change}", f", noise: {{position: {{{keys}}}}}", "s.position")


TWO = "world.sensors={a: {sensor: tracking, frame: ball}, b: {sensor: tracking, frame: red}}", "record.keep=all"

ROWS: dict[str, Row] = {
    "WorldSpec.sensors": row("world.sensors={s: {sensor: tracking, frame: nothing}}", error="no entity 'nothing'"),
    "SensorSpec.sensor": row(
        "world.sensors.s.sensor=imu",
        given=("world.sensors.s={sensor: tracking, frame: ball}", "task.observations.policy=[{term: sensor, of: s}]"),
        seen="episode",
    ),
    "SensorSpec.place": row(
        "world.sensors.s=arm.heel",
        given=(ARM, "world.sensors.s=arm.tip", "task.observations.policy=[{term: sensor, of: s}]"),
        seen="episode",
    ),
    "SensorSpec.rate": sensed("rate=25", "", "s.time"),
    "SensorSpec.delay": sensed("delay=2", "", "s.time"),
    "SensorSpec.dropout": sensed("dropout=0.9", "", "s.valid"),
    "SensorSpec.noise": sensed("noise={position: {bias: 0.1}}"),
    "SensorNoiseSpec.noise": noisy("noise=0.2", "noise: 0.1"),
    "SensorNoiseSpec.white": noisy("white=0.2", "white: 0.1"),
    "SensorNoiseSpec.bias": noisy("bias=0.2", "bias: 0.1"),
    "SensorNoiseSpec.walk": noisy("walk=0.2", "walk: 0.1"),
    "SensorNoiseSpec.walk_time": noisy("walk_time=0.1", "walk: 0.1"),
    "RecordSpec.sensors": row("record.sensors=[b]", given=TWO, seen="recorded"),
}
