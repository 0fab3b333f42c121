"""`anysim vqa`: questions about recorded episodes, with verified answers and images."""

from pathlib import Path
from typing import Annotated

import typer

from anysim.cli.options import AsJson


def vqa(
    directories: Annotated[list[Path], typer.Argument(metavar="RUN…", help="Recorded runs, or trajectories.")],
    out: Annotated[Path, typer.Option(help="Directory of the questions and images.")],
    moments: Annotated[int, typer.Option(min=1, help="Control steps of each episode to ask about.")] = 4,
    most: Annotated[
        int, typer.Option("--most", "-k", min=1, help="Questions of each episode, over all families.")
    ] = 60,
    phrasing: Annotated[int, typer.Option("--phrasing", "-p", min=0, help="Chooses questions and their words.")] = 0,
    images: Annotated[bool, typer.Option(help="Whether to add images.")] = True,
    forks: Annotated[bool, typer.Option(help="Whether to ask what would be otherwise; replays the episodes.")] = True,
    base: Annotated[
        Path | None, typer.Option(help="Folder of the recorded file, where its world has assets with relative paths.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Ask questions about recorded episodes: OUT/questions.jsonl with answers, and OUT/images.

    Answers follow from the recorded states. Each is found a second time, by other code from raw numbers, and what does
    not agree, or would change with a few millimetres, is not asked. Images are those of the recorded cameras, else
    drawn from the recorded states; where nothing can draw there are questions alone. A call that was cut off goes on
    with the next episode when it is made again; episodes that are there already, asked the same, stay as they are.

    Examples:
      anysim vqa runs/pick --out vqa/pick
      anysim vqa runs/pick --out vqa/pick --moments 8 --most 100 --no-images
    """
    from anysim.cli.output import counting, print_json
    from anysim.record.names import find_trajectories
    from anysim_language.vqa import QUESTIONS_FILE, QuestionOrder, write_questions

    found = find_trajectories(directories)
    with counting("episodes", len(found), quiet=json) as show:
        order = QuestionOrder(moments, most, phrasing, images, forks)
        made = write_questions(
            found,
            out,
            order,
            base,
            told=lambda path, count: show(f"{path.parent.parent.name}/{path.name}: {count} questions", ""),
        )
    if json:
        print_json(
            {
                "file": str(out / QUESTIONS_FILE),
                "questions": sum(made.questions.values()),
                "families": dict(sorted(made.questions.items())),
                "images": made.images,
                "left_out": len(made.wrong),
                "resumed": made.resumed,
                "without_images": {str(path): why for path, why in made.unseen.items()},
                "without_forks": {str(path): why for path, why in made.unforked.items()},
            }
        )
    else:
        for path, why in made.unseen.items():
            typer.echo(f"{path.name} has no images: {why}")
        for path, why in made.unforked.items():
            typer.echo(f"{path.name} is not asked what would be otherwise: {why}")
        for one in made.wrong:
            typer.echo(f"{one.trajectory.name} step {one.step}: left out, the checker disagrees: {one.question}")
        typer.echo(f"{sum(made.questions.values())} questions, {made.images} images -> {out / QUESTIONS_FILE}")
    if made.wrong:
        raise typer.Exit(1)
