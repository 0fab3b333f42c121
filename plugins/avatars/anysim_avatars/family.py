"""The family `avatar`: people with a queue of actions each, driven through the engine as they walk, reach and look."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from anysim.assets.uri import locate
from anysim.conventions import Array
from anysim.errors import AnysimError, SpecError, SpecIssue, TaskError, listing, suggest
from anysim.families.base import Family, FamilyPart, FamilySetting, FamilyState
from anysim.math import pose as P
from anysim.randomization.distributions import draw_one, nominal
from anysim.randomization.draw import draw_rows, is_random
from anysim_avatars import actions, bodies, clips, frames
from anysim_avatars.actions import LENGTH, WIDTH, Column, Kind
from anysim_avatars.bodies import BONES, Proportions, proportions
from anysim_avatars.facts import facts_of
from anysim_avatars.gait import STRETCH, Gait, Legs, Wish, advance, carrot, stand
from anysim_avatars.look import shapes
from anysim_avatars.motion import Motion, Provider, between, read_motion
from anysim_avatars.puppet import Aim, Figure, Sizes, figure, posed
from anysim_avatars.spec import ActionSpec, AvatarSpec
from anysim_schemas.base import Spec

FADE = 0.4
"""[s] from one posture to the next, and into gaze, reach and bend."""
PASS = 0.5
"""[m] from one point that is reached for to another, in the time that an action eases in."""
ROW = 0.9
"""[m] between avatars that begin at one place."""


class Avatars(Family):
    """People: capsule humans that walk without slipping, sit, talk, look, reach and bend, and push what they meet."""

    spec = AvatarSpec

    # ------------------------------------------------------------------ the World

    @classmethod
    def parts(cls, name: str, spec: Spec) -> Iterable[FamilyPart]:
        assert isinstance(spec, AvatarSpec)
        for number, one in enumerate(people(spec)):
            gait, legs = _gait(1), Legs.of([one], 1)
            own = spec.one(number)
            gait.pos[0] = float(nominal(own.x)), float(nominal(own.y)) + _aside(spec, number)
            gait.yaw[0] = float(nominal(own.yaw))
            stand(gait, legs, np.zeros((1, 2)))
            first = own.do[0] if own.do else ActionSpec()
            posture = _first(first.clip or "", np.array([first.seat]), legs)
            gait.hips[:] -= posture[:, clips.DROP]
            poses = figure(gait, Sizes.of([one], 1), _aim(posture)).poses[0]
            called = name if spec.number == 1 else f"{name}_{number}"
            shown = shapes(one) if spec.look == "body" else None
            yield FamilyPart(called, bodies.model(called, one, poses, shown), "person", driven=True)

    # ------------------------------------------------------------------ made

    def __init__(self, setting: FamilySetting) -> None:
        super().__init__(setting)
        assert isinstance(setting.spec, AvatarSpec)
        self.spec_ = setting.spec
        world = setting.engine.world
        entities = [world.entities[i] for i in setting.entities]
        self.names = tuple(entity.name for entity in entities)
        self.people, count = people(setting.spec), setting.spec.number
        self._every_leg = Legs.of(self.people, setting.engine.num_envs)
        self._every_size = Sizes.of(self.people, setting.engine.num_envs)
        self._capsules = [bodies.segments(one) for one in self.people]
        self.drives(body for entity in entities for body in range(entity.body_start, entity.body_stop))
        self._motions: list[Motion | None] = [None] * len(clips.CLIPS)
        self._clips = list(clips.CLIPS)
        for clip, file in setting.spec.motions.items():
            self._clips.append(clip)
            self._motions.append(self._read(clip, file))
        self.provider: Provider | None = None
        shapes = {
            "pos": (2,),
            "yaw": (),
            "vel": (2,),
            "feet": (2, 4),
            "phase": (),
            "lift": (4,),
            "hips": (),
            "posture": (clips.POSTURE,),
            "before": (clips.POSTURE,),
            "fade": (),
            "clock": (),
            "time": (),
            "head": (2,),
            "gazing": (),
            "gaze": (3,),
            "reaching": (2,),
            "reach": (2, 3),
            "missed": (2,),
            "bend": (),
            "motion": (),
            "looks": (3,),
        }
        for key, shape in shapes.items():
            self.remember(key, count, *shape)
        self.remember("swing", count, dtype=np.int64, bounds=(-1, 1))
        self.remember("playing", count, dtype=np.int64, bounds=(0, len(self._clips) - 1))
        self.remember("head_row", count, dtype=np.int64, bounds=(0, LENGTH - 1))
        self.remember("queue", count, LENGTH, WIDTH)
        self._points = self.remember("points", count * len(BONES), 3)
        self._speeds = self.remember("speeds", count * len(BONES), 3)
        self._each = [setting.spec.one(number) for number in range(count)]
        self._script = np.array([self._rows(one.do, self._path(i, "do")) for i, one in enumerate(self._each)])
        found = self.body, self.clip_number
        self._drawn = [(i, *value) for i, one in enumerate(self._each) for value in _drawn(one.do, *found)]

    def _path(self, number: int, key: str) -> str:
        """Where a key, `x` or `do.0.reach`, is said that holds for one of them."""
        own = getattr(self.spec_.own(number), key.partition(".")[0]) is not None
        return f"world.families.{self.setting.name}.{f'each.{number}.' if own else ''}{key}"

    def _read(self, clip: str, file: str) -> Motion:
        try:
            return read_motion(locate(file).path)
        except AnysimError as error:
            raise self.setting.fault(f"motions.{clip}", str(error)) from error

    def _rows(self, script: Sequence[ActionSpec], path: str) -> Array:
        issues: list[SpecIssue] = []
        for number, action in enumerate(script):
            try:
                actions.rows_of(action, self.body, self.clip_number)
            except AnysimError as error:
                issues.append(SpecIssue("", f"{path}.{number}", str(error)))
        if issues:
            raise SpecError(issues)
        try:
            return actions.queue(script, self.body, self.clip_number)
        except ValueError as error:
            raise SpecError([SpecIssue("", path, str(error))]) from None

    def clip_number(self, name: str) -> int:
        """The index of a clip; TaskError where there is none, which lists them."""
        if name not in self._clips:
            known = f"{suggest(name, self._clips)} (clips: {listing(self._clips)})"
            raise TaskError(f"there is no clip '{name}'{known}")
        return self._clips.index(name)

    # ------------------------------------------------------------------ what others ask of it

    def do(self, script: Sequence[ActionSpec], env_ids: Array, avatar: str | None = None) -> None:
        """Have an avatar, or all of them, do this from now on in these envs, in place of what they were about to do.

        Raises:
            TaskError: there is no such avatar or clip, or the queue would be too long.
        """
        if avatar is not None and avatar not in self.names:
            raise TaskError(
                f"there is no avatar '{avatar}'{suggest(avatar, self.names)} (there are: {listing(self.names)})"
            )
        which = range(len(self.names)) if avatar is None else [self.names.index(avatar)]
        try:
            rows = actions.queue(script, self.body, self.clip_number)
        except ValueError as error:
            raise TaskError(str(error)) from None
        for number in which:
            self.memory["queue"][env_ids, number] = rows
            self.memory["head_row"][env_ids, number] = 0
            self.memory["clock"][env_ids, number] = 0.0

    def provide(self, provider: Provider | None) -> None:
        """Let a function say how all avatars stand from the next step on, in place of their actions; None ends that.

        What it says must follow from its arguments alone: then snapshots and replays hold.
        """
        self.provider = provider

    # ------------------------------------------------------------------ its life

    def reset(self, env_ids: Array) -> None:
        memory, origin = self.memory, self.setting.origin[env_ids]
        for number, own in enumerate(self._each):
            beside = 0.0 if is_random(own.y) else _aside(self.spec_, number)
            x, y, yaw = (self._values(number, key, getattr(own, key), env_ids) for key in ("x", "y", "yaw"))
            memory["pos"][env_ids, number] = np.stack([x + origin[:, 0], y + beside + origin[:, 1]], axis=1)
            memory["yaw"][env_ids, number] = yaw
        memory["queue"][env_ids] = self._script
        for number, row, columns, key, value in self._drawn:
            drawn = self._values(number, f"do.{key}", value, env_ids)
            memory["queue"][env_ids, number, row, columns] = drawn.reshape(len(env_ids), -1)
        gait, legs, sizes = self._gait(env_ids), self._legs(env_ids), self._sizes(env_ids)
        stand(gait, legs, self._ground(gait.feet[:, :, :2] + gait.pos[:, None]))
        self._begin_as_told(env_ids, gait, legs, sizes)

    def _values(self, number: int, key: str, value: object, env_ids: Array) -> Array:
        """(n, …) a value of one of them in the episodes of these envs."""
        stream = f"family/{self.setting.name}/{number}/{key.replace('.', '/', 1)}"
        return draw_rows(value, stream, self.setting.streams, env_ids, source=self._path(number, key))

    def _begin_as_told(self, env_ids: Array, gait: Gait, legs: Legs, sizes: Sizes) -> None:
        """They hold the clip, gaze, reach and bend of their first action when an episode begins."""
        rows = len(gait.pos)
        first = self._take(env_ids, "queue")[:, 0]
        held = (first[:, Column.KIND] == Kind.CLIP) & (first[:, Column.CLIP] < len(clips.CLIPS))
        plays = np.where(held, first[:, Column.CLIP], 0).astype(np.int64)
        posture = _first("", first[:, Column.SEAT], legs)
        for number in np.unique(plays[held]):
            mine = held & (plays == number)
            seats, theirs = first[mine, Column.SEAT], Legs(*(values[mine] for values in legs))
            posture[mine] = _first(self._clips[number], seats, theirs)
        gait.hips[:] -= posture[:, clips.DROP]
        now = {"posture": posture, "before": posture, "fade": np.full(rows, FADE), "bend": first[:, Column.BEND]}
        now["playing"] = plays
        scene = self._scene(env_ids)
        now["gazing"], now["gaze"] = first[:, Column.GAZING], _points(scene, first, Column.GAZE_BODY, Column.GAZE)
        hand = first[:, Column.HAND].astype(int)
        now["reaching"], now["reach"] = np.zeros((rows, 2)), np.zeros((rows, 2, 3))
        now["reaching"][np.arange(rows), hand] = first[:, Column.REACHING]
        now["reach"][np.arange(rows), hand] = _points(scene, first, Column.REACH_BODY, Column.REACH)
        found = figure(
            gait, sizes, Aim(posture, now["bend"], now["gaze"], now["gazing"], now["reach"], now["reaching"])
        )
        now["missed"], now["looks"] = found.missed, found.looks
        self._keep(env_ids, gait, now)
        self._show(env_ids, found, None)

    def _scene(self, env_ids: Array) -> "Scene":
        poses = self.engine.get_state().body_pose[env_ids]
        return Scene(poses, self.setting.origin[env_ids], np.repeat(np.arange(len(env_ids)), len(self.names)))

    def before_step(self, env_ids: Array, duration: float) -> None:
        rows = len(env_ids) * len(self.names)
        now = {key: self._take(env_ids, key) for key in _FREE}
        gait, legs, sizes = self._gait(env_ids), self._legs(env_ids), self._sizes(env_ids)
        queue = self._take(env_ids, "queue")
        at = np.arange(rows)
        row = queue[at, now["head_row"]]
        scene = self._scene(env_ids)
        now["time"] += duration
        now["clock"] += duration
        done = self._over(row, gait, now, _goals(row, scene))
        if done.any():
            self._next(queue, now, done)
            self._keep(env_ids, gait, {"queue": queue})
        row = queue[at, now["head_row"]]
        kind, goal = row[:, Column.KIND], _goals(row, scene)
        going, turning = kind == Kind.GO, kind == Kind.TURN
        away = np.sqrt(((goal - gait.pos) ** 2).sum(-1))
        rest = np.maximum(away - row[:, Column.NEAR], 0.0) / np.maximum(away, 1e-12)
        short = gait.pos + (goal - gait.pos) * rest[:, None]
        wish = np.where(
            going[:, None], carrot(gait.pos, short, duration, row[:, Column.SPEED], row[:, Column.ENDS] > 0), 0.0
        )
        heading = np.where(turning, row[:, Column.YAW], gait.yaw)
        ahead = going & (away > 0.05)
        heading = np.where(ahead, np.arctan2(goal[:, 1] - gait.pos[:, 1], goal[:, 0] - gait.pos[:, 0]), heading)
        speed = np.sqrt((gait.vel * gait.vel).sum(-1))
        self._posture(now, row, gait, sizes, legs, speed, duration)
        advance(
            gait,
            legs,
            Wish(wish, heading, _height(gait, legs) - now["posture"][:, clips.DROP], now["posture"][:, clips.BACK]),
            self._ground,
            duration,
        )
        looked = _points(scene, row, Column.GAZE_BODY, Column.GAZE)
        self._overlays(now, row, looked, _points(scene, row, Column.REACH_BODY, Column.REACH), duration)
        aim = Aim(
            now["posture"], now["bend"], now["gaze"], _eased(now["gazing"]), now["reach"], _eased(now["reaching"])
        )
        found = figure(gait, sizes, aim)
        now["missed"], now["looks"] = found.missed, found.looks
        now["step"] = np.full(rows, duration)
        found = self._moved(env_ids, now, row, found, gait, sizes)
        self._keep(env_ids, gait, now)
        self._show(env_ids, found, duration)

    # ------------------------------------------------------------------ actions

    def _over(self, row: Array, gait: Gait, now: Mapping[str, Array], goal: Array) -> Array:
        """Which actions (m,) are over."""
        kind = row[:, Column.KIND]
        gap = np.sqrt(((goal - gait.pos) ** 2).sum(-1))
        through = row[:, Column.ENDS] == 0
        arrived = gap <= np.where(through, 0.35, row[:, Column.NEAR] + 1e-3)
        stands = (gait.swing < 0) | through
        turned = (np.abs(P.wrapped(row[:, Column.YAW] - gait.yaw)) < 0.01) & (gait.swing < 0)
        ends = [np.inf if motion is None else motion.seconds for motion in self._motions]
        lasts = np.minimum(
            row[:, Column.SECONDS], np.array(ends)[np.clip(row[:, Column.CLIP].astype(int), 0, len(ends) - 1)]
        )
        return np.select(
            [kind == Kind.GO, kind == Kind.TURN, kind == Kind.CLIP],
            [arrived & stands, turned, now["clock"] >= lasts],
            False,
        )

    def _next(self, queue: Array, now: dict[str, Array], done: Array) -> None:
        """Go on to the next action where one is over; begin anew after the last where that is wished."""
        head = now["head_row"]
        for i in np.flatnonzero(done):
            following = int(head[i]) + 1
            last = following >= LENGTH or queue[i, following, Column.KIND] == Kind.NOTHING
            if last and not self.spec_.again:
                queue[i] = 0.0
            head[i], now["clock"][i] = 0 if last else following, 0.0

    def _posture(
        self, now: dict[str, Array], row: Array, gait: Gait, sizes: Sizes, legs: Legs, speed: Array, dt: float
    ) -> None:
        """The posture of the clip that plays, and on the way to it from what was."""
        clip = np.where(row[:, Column.KIND] == Kind.NOTHING, self._clips.index("idle"), row[:, Column.CLIP])
        clip = np.clip(clip.astype(np.int64), 0, len(self._clips) - 1)
        clip = np.where((clip == self._clips.index("walk")) & (speed < 0.02) & (gait.swing < 0), 0, clip)
        changed = clip != now["playing"]
        now["before"][changed], now["fade"][changed] = now["posture"][changed], 0.0
        now["playing"] = clip
        now["fade"] = np.minimum(now["fade"] + dt, FADE)
        drop = np.maximum(legs.ankle + legs.leg - row[:, Column.SEAT] - 0.1, 0.0)
        angle = np.pi * (gait.phase + (gait.swing == 1))
        moment = clips.Moment(now["time"], angle, speed, drop)
        wanted = np.empty_like(now["posture"])
        for number in np.unique(clip):
            rows = np.flatnonzero(clip == number)
            made = clips.CLIPS.get(self._clips[number], clips.idle)
            wanted[rows] = made(clips.Moment(*(values[rows] for values in moment)))
        share = _eased(now["fade"] / FADE)[:, None]
        now["posture"] = now["before"] + share * (wanted - now["before"])

    def _overlays(self, now: dict[str, Array], row: Array, looked: Array, target: Array, dt: float) -> None:
        """Gaze, reach and bend come and go over the action's `ease` [s]; while one goes, it is about where it was."""
        gazing, reaching = row[:, Column.GAZING] > 0, row[:, Column.REACHING] > 0
        rate = dt / np.where(row[:, Column.EASE] > 0.0, row[:, Column.EASE], FADE)
        now["gaze"][gazing] = looked[gazing]
        now["gazing"] = np.clip(now["gazing"] + np.where(gazing, rate, -rate), 0.0, 1.0)
        for hand in (0, 1):
            mine = reaching & (row[:, Column.HAND] == hand)
            before, share = now["reach"][mine, hand], now["reaching"][mine, hand]
            now["reach"][mine, hand] = _onward(before, target[mine], PASS * rate[mine], share)
            now["reaching"][:, hand] = np.clip(now["reaching"][:, hand] + np.where(mine, rate, -rate), 0.0, 1.0)
        now["bend"] += np.clip(row[:, Column.BEND] - now["bend"], -1.2 * dt, 1.2 * dt)

    def _moved(
        self, env_ids: Array, now: dict[str, Array], row: Array, found: Figure, gait: Gait, sizes: Sizes
    ) -> Figure:
        """The figure with a recording, or what a provider says, in its place; both come and go over FADE [s]."""
        clip = np.where(row[:, Column.KIND] == Kind.CLIP, row[:, Column.CLIP], 0).astype(np.int64)
        clip = np.clip(clip, 0, len(self._motions) - 1)
        number = np.tile(np.arange(len(self.names)), len(env_ids))
        playing = np.array([motion is not None for motion in self._motions])[clip] | (self.provider is not None)
        step = np.where(playing, 1.0, -1.0) * now.pop("step") / FADE
        now["motion"] = np.clip(now["motion"] + step, 0.0, 1.0)
        if not playing.any():
            return found
        quaternions, hips = frames.quaternions(found.rotation), found.start[:, 0].copy()
        share = _eased(now["motion"])
        for which in {int(clip[i]) for i in np.flatnonzero(playing)} if self.provider is None else {-1}:
            rows = np.flatnonzero(playing & (clip == which)) if which >= 0 else np.arange(len(clip))
            source = self._motions[which] if which >= 0 else self.provider
            assert source is not None
            stance = source(now["clock"][rows], number[rows])
            level = frames.turned(gait.yaw[rows], np.zeros(len(rows)))
            way = frames.apply(level, stance.hips * (sizes.bones[rows, 9] + sizes.bones[rows, 11])[:, None])
            way += np.concatenate([gait.pos[rows], sizes.ankle[rows, None]], axis=-1)
            turned = P.multiply(frames.quaternions(level)[:, None], stance.rotation)
            quaternions[rows] = between(quaternions[rows], turned, share[rows, None, None])
            hips[rows] += share[rows, None] * (way - hips[rows])
        moved = posed(hips, P.to_matrix(quaternions), sizes)
        return Figure(
            *(np.where(playing.reshape(-1, *[1] * (a.ndim - 1)), b, a) for a, b in zip(found, moved, strict=True))
        )

    # ------------------------------------------------------------------ rows of the memory

    def _take(self, env_ids: Array, key: str) -> Array:
        """(n * avatars, …) of the memory, a copy."""
        array = self.memory[key][env_ids]
        return array.reshape(-1, *array.shape[2:])

    def _gait(self, env_ids: Array) -> Gait:
        return Gait(*(self._take(env_ids, key) for key in Gait._fields))

    def _legs(self, env_ids: Array) -> Legs:
        return Legs(*(rows[: len(env_ids) * len(self.people)] for rows in self._every_leg))

    def _sizes(self, env_ids: Array) -> Sizes:
        return Sizes(*(rows[: len(env_ids) * len(self.people)] for rows in self._every_size))

    def _keep(self, env_ids: Array, gait: Gait, more: Mapping[str, Array]) -> None:
        """Write rows back."""
        for key, rows in {**gait._asdict(), **more}.items():
            self.memory[key][env_ids] = rows.reshape(len(env_ids), len(self.names), *rows.shape[1:])

    def _ground(self, points: Array) -> Array:
        heights = self.engine.world.ground.heights_at(points)
        return np.where(np.isfinite(heights), heights, 0.0)

    def _show(self, env_ids: Array, found: Figure, duration: float | None) -> None:
        """Drive the bodies to where the figures are, or put them there."""
        poses = found.poses.reshape(len(env_ids), -1, 7)
        points = found.start.reshape(len(env_ids), -1, 3)
        if duration is None:
            self.place(env_ids, poses)
            self._speeds[env_ids] = 0.0
        else:
            self.drive(env_ids, poses, duration)
            self._speeds[env_ids] = (points - self._points[env_ids]) / duration
        self._points[env_ids] = points

    # ------------------------------------------------------------------ what there is to see

    def state(self, env_ids: Array) -> FamilyState:
        """Its joints: the beginnings of the bones."""
        radius = np.array([capsule[0] for one in self.people for capsule in bodies.capsules(one)])
        ids = np.repeat(np.array(self.setting.entities, dtype=np.int32) + 1, len(BONES))
        return FamilyState(self._points[env_ids].copy(), self._speeds[env_ids].copy(), radius, ids)

    def gap(self, poses: Array, number: int, points: Array) -> Array:
        """(n,) [m] from points (n, 3) to the nearest surface of an avatar, of poses (n, B, 7) of all bodies."""
        own = poses[:, self._driven[number * len(BONES) : (number + 1) * len(BONES)]]
        ends, radii = self._capsules[number]
        a, b = (own[..., :3] + P.rotate(own[..., 3:], np.broadcast_to(end, own[..., :3].shape)) for end in ends)
        way, to = b - a, points[:, None] - a
        share = np.clip(P.dot(to, way) / np.maximum(P.dot(way, way), 1e-12), 0.0, 1.0)
        return (P.norm(to - share[..., None] * way) - radii).min(axis=1)

    def facts(self, env: int) -> Mapping[str, Mapping[str, object]]:
        bodies_ = [body.name for body in self.engine.world.bodies]
        taken = {key: self.memory[key][env] for key in ("queue", "head_row", "playing", "pos", "vel")}
        found: dict[str, Mapping[str, object]] = {}
        for number, name in enumerate(self.names):
            rows = {key: array[number] for key, array in taken.items()}
            clip = self._clips[int(rows["playing"])]
            found[name] = facts_of(rows["queue"][rows["head_row"]], clip, rows, self.people[number].height, bodies_)
        return found

    def recorded(self, env_ids: Array) -> Mapping[str, Array]:
        keys = ("pos", "yaw", "vel", "playing", "looks", "missed", "reaching", "gazing")
        return {key: self.memory[key][env_ids].astype(float) for key in keys}


_FREE = (
    "posture",
    "before",
    "fade",
    "clock",
    "time",
    "head",
    "gazing",
    "gaze",
    "reaching",
    "reach",
    "missed",
    "bend",
    "motion",
    "looks",
    "playing",
    "head_row",
)


def people(spec: AvatarSpec) -> list[Proportions]:
    """The avatars of a spec, as its seed makes them."""
    found: list[Proportions] = []
    for number in range(spec.number):
        rng = np.random.default_rng([spec.seed, number])
        tall = float(draw_one(spec.height, rng.random) if is_random(spec.height) else nominal(spec.height))
        found.append(proportions(tall, rng))
    return found


def _first(clip: str, seat: Array, legs: Legs) -> Array:
    """(m, POSTURE) how avatars are held when an episode begins: as a clip holds them, or standing."""
    zero = np.zeros(len(seat))
    drop = np.maximum(legs.ankle + legs.leg - seat - 0.1, 0.0)
    made = clips.CLIPS.get(clip)
    return clips.standing(len(seat)) if made is None else made(clips.Moment(zero, zero, zero, drop))


def _drawn(
    script: Sequence[ActionSpec], body: actions.FindBody, clip: actions.FindClip
) -> Iterable[tuple[int, slice, str, object]]:
    """Row and columns of each value of a script that is drawn anew in each episode, its path in there, and itself."""
    row = 0
    for number, action in enumerate(script):
        for key, columns in actions.DRAWN.items():
            if is_random(value := getattr(action, key)):
                yield row, columns, f"{number}.{key}", value
        row += len(actions.rows_of(action, body, clip))


def _onward(point: Array, target: Array, most: Array, share: Array) -> Array:
    """(m, 3) the point that a palm is put to next: no faster from one point to another than it comes to one."""
    gap = target - point
    far = P.norm(gap)
    step = np.minimum(most, far)
    return np.where((share > 0.0)[:, None], point + gap * (step / np.maximum(far, 1e-12))[:, None], target)


def _aside(spec: AvatarSpec, number: int) -> float:
    """[m] to the left of where all begin, if it is not said of this one."""
    return 0.0 if spec.own(number).y is not None else ROW * number


def _gait(rows: int) -> Gait:
    return Gait(
        np.zeros((rows, 2)),
        np.zeros(rows),
        np.zeros((rows, 2)),
        np.zeros((rows, 2, 4)),
        np.full(rows, -1),
        np.zeros(rows),
        np.zeros((rows, 4)),
        np.zeros(rows),
    )


def _height(gait: Gait, legs: Legs) -> Array:
    """(m,) the height of the hips of a body that stands straight."""
    return gait.feet[:, :, 2].min(axis=1) + legs.ankle + STRETCH * legs.leg


def _aim(posture: Array) -> Aim:
    """Nothing beside a posture."""
    rows = len(posture)
    return Aim(
        posture, np.zeros(rows), np.zeros((rows, 3)), np.zeros(rows), np.zeros((rows, 2, 3)), np.zeros((rows, 2))
    )


def _eased(share: Array) -> Array:
    """From 0 to 1 with no jerk; exactly 1 at the end."""
    return np.where(share >= 1.0, 1.0, share**3 * (10 - 15 * share + 6 * share**2))


class Scene(NamedTuple):
    """Poses of all bodies (n, B, 7) and origins (n, 3) of the envs at hand, and the env of each avatar (m,)."""

    poses: Array
    origin: Array
    env: Array


def _goals(row: Array, scene: Scene) -> Array:
    """(m, 2) where the walks go."""
    body = np.clip(row[:, Column.BODY].astype(np.int64), -1, scene.poses.shape[1] - 1)
    point = row[:, Column.X : Column.Y + 1] + scene.origin[scene.env, :2]
    return np.where((body >= 0)[:, None], scene.poses[scene.env, body, :2], point)


def _points(scene: Scene, row: Array, body: int, place: int) -> Array:
    """(m, 3) what rows are after: points, or where bodies are."""
    index = np.clip(row[:, body].astype(np.int64), -1, scene.poses.shape[1] - 1)
    point = row[:, place : place + 3] + scene.origin[scene.env]
    return np.where((index >= 0)[:, None], scene.poses[scene.env, index, :3], point)
