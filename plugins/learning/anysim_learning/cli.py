"""`anysim train`: a policy learns a task; `anysim curves`: trainings on one page."""

from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from anysim.cli.options import AsJson, Engine, Overrides, Task, option_values

if TYPE_CHECKING:
    from collections.abc import Iterator


def train(
    task: Task,
    learner: Annotated[
        str, typer.Option("--learner", "-l", help="sb3-ppo, rsl-rl, clone, or another installed one.")
    ] = "sb3-ppo",
    engine: Engine = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="When to end: control steps of all envs, or steps of descent of `clone`.")
    ] = None,
    num_envs: Annotated[int, typer.Option("--num-envs", "-n", min=1, help="Parallel environments.")] = 32,
    seed: Annotated[int, typer.Option("--seed", "-s", min=0, help="Of episodes, weights and noise.")] = 0,
    privileged: Annotated[
        bool, typer.Option("--privileged", help="Learn from the observations that only a simulator knows, too.")
    ] = False,
    data: Annotated[
        list[Path] | None, typer.Option("--data", help="A run to learn from, for `clone`; may be repeated.")
    ] = None,
    start: Annotated[
        Path | None, typer.Option("--from", help="A directory of `anysim train`: begin with the networks learnt there.")
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option("--option", help="A hyperparameter, KEY=VALUE; may be repeated.")
    ] = None,
    exams: Annotated[
        int,
        typer.Option(min=1, help="How often on the way the policy is tried without noise, and a checkpoint written."),
    ] = 20,
    level: Annotated[str | None, typer.Option(help="A level of difficulty that the task has.")] = None,
    override: Overrides = None,
    out: Annotated[Path | None, typer.Option(help="Directory of the results; default runs/train-….")] = None,
    video: Annotated[bool, typer.Option(help="Film an episode of the best policy at the end.")] = True,
    json: AsJson = False,
) -> None:
    """Train a policy on a task, and write it as policy.onnx.

    The same command again goes on from the last checkpoint, as if it had not been interrupted; with more --steps, on
    from the end. `tensorboard --logdir DIR` draws the curves while it learns; curves.html has the exams as pictures
    and curve.jsonl as numbers: success without noise in 64 episodes of the validation split. The policy of the best
    exam is the one that is kept, and filmed at the end. --from begins with what a training of a task has learnt that
    observes the same, or the first of it. `clone` sees the images that the task observes, too.

    Needs torch: pip install 'anysim-learning[sb3]' (or [rsl], or [torch] for `clone`), best in an environment of its
    own.

    Examples:
      anysim train reach --steps 2000000
      anysim train pick_cube --privileged --engine mujoco --num-envs 64
      anysim train go1_velocity_rough --learner rsl-rl --from runs/train-go1_velocity-rsl-rl-0 --option width=128
      anysim train pick_cube --learner clone --data runs/pick_cube --privileged
      anysim evaluate reach --policy runs/train-reach-sb3-ppo-0/policy.onnx --split test --engine all
    """
    from anysim import registry
    from anysim.api import make
    from anysim.cli.output import print_json
    from anysim.errors import PluginError, listing
    from anysim.plugin_parameters import checked, options_model, parameters
    from anysim.record.incoming import claim
    from anysim_learning.batch import POLICY
    from anysim_learning.curves import PAGE
    from anysim_learning.gymnasium import PRIVILEGED
    from anysim_learning.learner import Lesson
    from anysim_learning.train import CHECKPOINT, describe_training, train as run

    folder = out or Path("runs") / "-".join(["train", Path(task).stem, *([level] if level else []), learner, str(seed)])
    overrides = [*(override or ()), *([] if level is None else [f"level={level}"]), "record.cameras=[]"]
    made = registry.load("learners", learner)
    if missing := [name for name in getattr(made, "needs", ()) if find_spec(name) is None]:
        remedy = f"pip install 'anysim-learning[{_EXTRAS.get(learner, 'torch')}]', best in an environment of its own"
        raise PluginError(f"the learner '{learner}' needs {listing(missing)}, which is not installed: {remedy}")
    given = checked(options_model(made), option_values(option, "gamma=0.99"), "option")
    with (
        claim(folder),
        make(task, engine=engine, num_envs=num_envs, overrides=overrides, curriculum=True) as env,
        make(task, engine=engine, num_envs=_EXAMINED, overrides=overrides) as examined,
    ):
        groups = (POLICY, PRIVILEGED) if privileged and PRIVILEGED in env.observation_sizes else (POLICY,)
        runs = tuple(path.resolve() for path in data or ())
        coloured = tuple(name for name, shape in env.image_shapes.items() if len(shape) == 3)
        images = coloured if getattr(made, "sees_images", False) else ()
        about = _about(env, learner, (*groups, *images), seed, given.model_dump(), runs)
        describe_training(folder, about if start is None else {**about, "from": str(start.resolve())})
        lesson = Lesson(env, groups, seed, runs, images)
        with registry.using("learners", learner, (ValueError,)):
            driven = made(lesson, **{key: getattr(given, key) for key in parameters(made)})
        if start is not None and not (folder / CHECKPOINT).exists():
            from anysim_learning.adopt import begin_with

            begin_with(driven, lesson, start)
        total = steps or getattr(made, "default_steps", 1_000_000)
        with _telling(f"{learner} on {env.name}, {env.engine.name}", total, json) as tell:
            numbers = run(driven, lesson, examined, total, exams, folder, tell)
        drawn_by = env.engine.name
    film = _film_best(task, drawn_by, overrides, folder, len(groups) > 1) if video else None
    if json:
        print_json({"policy": str(folder / "policy.onnx"), **numbers, "video": film})
    else:
        best = f"{numbers['best']:.0%} of {_EXAMINED} episodes of the validation split solved"
        typer.echo(f"the best of {exams} exams: {best}, which flatters; the test split says how good the policy is")
        typer.echo(f"processor time: {numbers['cpu_s']:,.0f} s, exams included; the curves: {folder / PAGE}")
        shown = " --privileged" if len(groups) > 1 else ""
        typer.echo(f"next: anysim evaluate {task} --policy {folder / 'policy.onnx'}{shown} --split test --engine all")


def curves(
    runs: Annotated[list[Path], typer.Argument(metavar="DIR...", help="Directories of trainings.")],
    out: Annotated[Path, typer.Option(help="The page.")] = Path("curves.html"),
) -> None:
    """Draw the exams of several trainings, as of several seeds, on one page.

    Examples:
      anysim curves runs/train-reach-rsl-rl-0 runs/train-reach-rsl-rl-1 --out seeds.html
    """
    from anysim.record.commit import write_whole
    from anysim_learning.curves import page, read_curve

    named = {str(folder): read_curve(folder) for folder in runs}
    out.parent.mkdir(parents=True, exist_ok=True)
    write_whole(out.parent, {out.name: page(named)})
    typer.echo(f"the page: {out}")


def _film_best(task: str, engine: str, overrides: Sequence[str], folder: Path, privileged: bool) -> str | None:
    """The path of the video of the best policy, which the page of the curves then shows; None where there is none."""
    from anysim.record.commit import write_whole
    from anysim_learning.curves import PAGE, page, read_curve
    from anysim_learning.filming import film_best

    made = film_best(task, engine, overrides, folder / "policy.onnx", privileged)
    if made.missing:
        typer.echo(f"no video of the policy: {made.missing}", err=True)
        return None
    write_whole(folder, {PAGE: page({folder.name: read_curve(folder)}, made.path)})
    return str(folder / made.path)


_EXTRAS = {"sb3-ppo": "sb3", "rsl-rl": "rsl", "clone": "torch"}
_EXAMINED = 64


def _about(
    env: Any, learner: str, groups: Sequence[str], seed: int, options: Mapping[str, Any], data: Sequence[Path]
) -> dict[str, Any]:
    """What a training depends on."""
    from anysim.task.snapshot import spec_hash

    return {
        "task": env.name,
        "spec": spec_hash(env.spec),
        "engine": f"{env.engine.name} {env.engine.version}",
        "num_envs": env.num_envs,
        "learner": learner,
        "groups": list(groups),
        "seed": seed,
        "options": dict(options),
        "data": [str(path) for path in data],
    }


@contextmanager
def _telling(what: str, total: int, quiet: bool) -> "Iterator[Any]":
    """A bar for a person, a line now and then in a pipe."""
    from anysim.cli.output import interactive

    def words(numbers: Mapping[str, float]) -> str:
        shown = {k: v for k, v in numbers.items() if k != "steps" and "/" not in k}
        return ", ".join(f"{name} {value:.3g}" for name, value in shown.items())

    if quiet:
        yield lambda numbers: None
    elif not interactive():
        yield (
            lambda numbers: (
                typer.echo(f"{numbers['steps']} of {total}: {words(numbers)}") if "exam" in numbers else None
            )
        )
    else:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:,.0f} of {task.total:,.0f} steps"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[words]}"),
        )
        with Progress(*columns) as progress:
            bar = progress.add_task(what, total=total, words="")
            yield lambda numbers: progress.update(bar, completed=numbers["steps"], words=words(numbers))
