"""The page: its addresses, and what each answers."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

from jinja2 import Environment, PackageLoader
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, RedirectResponse, Response
from starlette.routing import Route

from anysim import __version__, registry
from anysim.errors import AnysimError, TaskError, listing, suggest
from anysim_app import installed
from anysim_app.door import Door
from anysim_app.found import SHOWN, Entry, entries
from anysim_app.programs import Program, Programs, unused
from anysim_serving.catalogue import Catalogue
from anysim_serving.server import Service, fresh_token
from anysim_serving.settings import Limits, Settings

Answer = Callable[[Request], Awaitable[Response]]


def serving_app(root: Path, port: int, token: str | None = None) -> tuple[Service, str]:
    """The page as a service on 127.0.0.1, which is not begun, and its address with the token.

    Raises:
        TaskError: the port cannot be had.
    """
    settings = Settings(port=port, token=token or fresh_token(), limits=Limits(body_bytes=1 << 14))
    programs = Programs()
    catalogue = Catalogue.of(registry.names("tasks")[:1], all_tasks=True)
    service = Service(catalogue, settings, lambda *_: application(root, programs), Door)
    return service, f"{service.address}/?token={settings.token}"


def application(root: Path, programs: Programs) -> Starlette:
    """The application over a folder of runs; it ends its programs when it is stopped."""

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        del app
        try:
            yield
        finally:
            await asyncio.to_thread(programs.close)

    pages = Pages(root, programs)
    routes = [
        Route("/", _told(pages.overview)),
        Route("/tasks/{task}", _told(pages.task)),
        Route("/tasks/{task}/picture", _told(pages.picture)),
        Route("/robots", _told(pages.robots)),
        Route("/runs", _told(pages.runs)),
        Route("/runs/{key}", _told(pages.run)),
        Route("/files/{key}/{name:path}", _told(pages.file)),
        Route("/programs", _told(pages.programs)),
        Route("/programs/{number:int}", _told(pages.program)),
        Route("/start", _told(pages.start), methods=["POST"]),
        Route("/programs/{number:int}/stop", _told(pages.stop), methods=["POST"]),
    ]
    return Starlette(routes=routes, lifespan=lifespan)


def _told(answer: Callable[[Request], Response]) -> Answer:
    """An answer that is made on a thread, and whose errors are a page with a sentence."""

    async def made(request: Request) -> Response:
        if request.method == "POST":
            form = parse_qs((await request.body()).decode("utf-8", "replace"))
            request.state.form = {key: values[0] for key, values in form.items()}
        try:
            return await asyncio.to_thread(answer, request)
        except AnysimError as error:
            return HTMLResponse(_html("error.html", words=str(error)), 400)

    return made


_templates = Environment(loader=PackageLoader("anysim_app"), autoescape=True, trim_blocks=True, lstrip_blocks=True)


def _html(template: str, **values: Any) -> str:
    return _templates.get_template(template).render(version=__version__, **values)


class Pages:
    """The pages over a folder of runs."""

    def __init__(self, root: Path, programs: Programs) -> None:
        self._root, self._programs = root, programs

    # ------------------------------------------------------------------ what is installed

    def overview(self, request: Request) -> Response:
        """Engines, tasks by family, the newest runs, and what runs."""
        del request
        families: dict[str, list[dict[str, Any]]] = {}
        for task in installed.tasks().values():
            families.setdefault(task["family"], []).append(task | {"picture": installed.picture(task["name"])})
        newest = [(entry, entry.told()) for entry in entries(self._root)[:6]]
        values = {"engines": installed.engines(), "families": families, "newest": newest, "root": self._root}
        return HTMLResponse(_html("overview.html", programs=self._programs.all()[:4], **values))

    def task(self, request: Request) -> Response:
        """A task: its picture, its words, its YAML, and what can be started of it."""
        task = self._task(request.path_params["task"])
        values = {"task": task, "picture": installed.picture(task["name"]), "source": installed.source(task["name"])}
        return HTMLResponse(_html("task.html", engines=installed.runnable(), **values))

    def picture(self, request: Request) -> Response:
        """The picture of a task."""
        path = installed.picture(request.path_params["task"])
        return Response(status_code=404) if path is None else FileResponse(path, media_type="image/jpeg")

    def robots(self, request: Request) -> Response:
        """The robots of the catalogue."""
        del request
        return HTMLResponse(_html("robots.html", robots=installed.robots()))

    def _task(self, name: str) -> dict[str, Any]:
        known = installed.tasks()
        if name not in known:
            raise TaskError(
                f"there is no task '{name[:60]}'{suggest(name[:60], list(known))} (tasks: {listing(known)})"
            )
        return known[name]

    # ------------------------------------------------------------------ what was recorded

    def runs(self, request: Request) -> Response:
        """All that lies in the folder of runs."""
        del request
        found = [(entry, entry.told()) for entry in entries(self._root)]
        return HTMLResponse(_html("runs.html", entries=found, root=self._root))

    def run(self, request: Request) -> Response:
        """A run: its episodes with their videos, and its pages."""
        entry = self._entry(request.path_params["key"])
        return HTMLResponse(_html("run.html", entry=entry, told=entry.told(), episodes=entry.episodes()))

    def file(self, request: Request) -> Response:
        """A page, video or picture of an entry: one of those that were listed, and no other."""
        entry = self._entry(request.path_params["key"])
        path = entry.files.get(request.path_params["name"])
        if path is None:
            raise TaskError(f"{entry.name} has no such file to be shown (files: {listing(entry.files)})")
        return FileResponse(path, media_type=SHOWN[path.suffix])

    def _entry(self, key: str) -> Entry:
        found = next((entry for entry in entries(self._root) if entry.key == key), None)
        if found is None:
            raise TaskError(f"there is no such run in {self._root}; it may have been moved: see the list of runs")
        return found

    # ------------------------------------------------------------------ what runs

    def programs(self, request: Request) -> Response:
        """What was started."""
        del request
        return HTMLResponse(_html("programs.html", programs=self._programs.all()))

    def program(self, request: Request) -> Response:
        """A program: what it prints, and where the page is that it serves."""
        return HTMLResponse(_html("program.html", program=self._program(request)))

    def start(self, request: Request) -> Response:
        """Start a view, a run or a comparison of a task, or a view of a run; nothing else can be started."""
        form: dict[str, str] = request.state.form
        words = self._words(form.get("what", ""), form)
        return RedirectResponse(f"/programs/{self._programs.start(*words).number}", 303)

    def _words(self, what: str, form: dict[str, str]) -> list[str]:
        if what == "replay":
            return ["view", str(self._entry(form.get("run", "")).folder), "--port", "0"]
        task = self._task(form.get("task", ""))
        name = task["name"]
        if what == "compare":
            out, seed = unused(self._root / "compare", name)
            return ["compare", name, "--episodes", "4", "--seed", str(seed), "--out", str(out)]
        engine = form.get("engine", "")
        if engine not in installed.runnable():
            raise TaskError(f"there is no engine '{engine[:40]}' here (engines: {listing(installed.runnable())})")
        if what == "view":
            acts = ["--policy", "expert", "--play"] if task["expert"] else []
            return ["view", name, "-e", engine, *acts, "--port", "0"]
        if what == "run":
            if not task["expert"]:
                raise TaskError(f"{name} has no expert whose episodes could be recorded; look at it with a view")
            out, seed = unused(self._root, f"{name}-{engine}")
            count = ["--episodes", "4", "-n", "4", "--seed", str(seed)]
            return ["run", name, "-e", engine, *count, "--out", str(out)]
        raise TaskError(f"'{what[:40]}' is nothing that can be started (view, run, compare, replay)")

    def stop(self, request: Request) -> Response:
        """End a program."""
        program = self._program(request)
        self._programs.stop(program)
        return RedirectResponse(f"/programs/{program.number}", 303)

    def _program(self, request: Request) -> Program:
        number = request.path_params["number"]
        found = self._programs.get(number)
        if found is None:
            raise TaskError(
                f"there is no program {number} (programs: {listing([p.title for p in self._programs.all()])})"
            )
        return found
