"""Acting: commands into the live hierarchy of skills, and time that passes."""

from collections.abc import Iterator, Mapping
from typing import Any

from anysim.errors import PluginError, SpecError, SpecIssue, TaskError, listing, suggest
from anysim.plugin_parameters import checked, parameters, reference_kind
from anysim.task.term_registry import find
from anysim_agents.answers import Answer
from anysim_agents.arguments import OfSession, RunCommand, RunSkill, Wait
from anysim_agents.toolbox.catalog import commands
from anysim_agents.workspace import Told, Workspace
from anysim_agents.worlds import paths_of, refuse_files
from anysim_schemas.collect import CollectSpec, CommandSpec


async def run_skill(workspace: Workspace, args: RunSkill, told: Told | None) -> Answer:
    """Give a robot one command, such as pick, place, open or push, and wait for how it ends.

    It ends `ok`, or with a typed failure (no_ik, collision, missed_contact, timeout, ...), with what was tried
    and what to do about it. The robot goes on from where the last command left it. Names of things are those of
    `observe`.
    """
    command: dict[str, Any] = {"do": args.skill, **args.parameters}
    if args.timeout is not None:
        command["timeout"] = args.timeout
    return await _run(workspace, args.session, [command], "stop", args, told, "run_skill")


async def run_command(workspace: Workspace, args: RunCommand, told: Told | None) -> Answer:
    """Give a robot several commands, one after the other, as in a task's file, and wait for how they end.

    Each may have a condition (`if`), a check (`success`) and a `timeout` of its own. Nothing is done unless all
    of them are right.
    """
    if len(args.commands) > workspace.limits.commands:
        raise TaskError(f"run_command.commands: at most {workspace.limits.commands} at once, got {len(args.commands)}")
    return await _run(workspace, args.session, args.commands, args.on_fail, args, told, "run_command")


async def _run(
    workspace: Workspace,
    handle: str,
    given: Any,
    on_fail: str,
    args: RunSkill | RunCommand,
    told: Told | None,
    tool: str,
) -> Answer:
    entry = workspace.entry(handle)
    workspace.refuse_busy(entry)
    try:
        specs = _checked(given, on_fail)
        return Answer(await workspace.command(entry, specs, args.envs, args.wait, told))
    except SpecError as error:
        raise SpecError([_explained(issue, given, tool) for issue in error.issues]) from None


def _explained(issue: SpecIssue, given: Any, tool: str) -> SpecIssue:
    """The issue where the agent wrote it, with what the command takes."""
    _, number, *key = issue.path.split(".")
    at = f"{tool}.{issue.path}"
    if tool == "run_skill":
        at = f"run_skill.{'skill' if key == ['do'] else '.'.join(['parameters', *key])}"
    one = given[int(number)]
    skill = one.get("do") if isinstance(one, dict) else one
    made = commands().get(str(skill))
    words = issue.message
    if isinstance(skill, str) and made is not None and key != ["do"]:
        hidden = paths_of(skill)
        taken = [
            name if p.default is not p.empty or reference_kind(p.annotation) == "robot" else f"{name} (required)"
            for name, p in parameters(made).items()
            if name not in hidden
        ]
        words += f" ({skill} takes: {listing(taken, 40)}; describe kind: command, name: {skill})"
    return SpecIssue("", at, words)


def _checked(given: Any, on_fail: str) -> CollectSpec:
    """Commands as those of a file: with known skills, and without files.

    Raises:
        SpecError: at `commands.0.object`, what is wrong.
    """
    known, issues, found = commands(), list[SpecIssue](), list[CommandSpec]()
    for number, one in enumerate(given):
        path = f"commands.{number}"
        one = {"do": one} if isinstance(one, str) else one
        if not isinstance(one, dict) or not isinstance(one.get("do"), str):
            words = (
                "a command is a mapping such as {do: pick, object: cube}; `do` is one of list_catalog kind: commands"
            )
            issues.append(SpecIssue("", path, words))
            continue
        skill = one["do"]
        if skill not in known:
            words = (
                f"there is no command '{skill[:60]}'{suggest(skill[:60], list(known))} (list_catalog kind: commands)"
            )
            issues.append(SpecIssue("", f"{path}.do", words))
            continue
        own = {key: value for key, value in one.items() if key not in CommandSpec.model_fields and key != "if"}
        issues += refuse_files(skill, own, path)
        issues += _unknown_terms(one, path)
        try:
            found.append(checked(CommandSpec, one, path))  # type: ignore[arg-type]
        except SpecError as error:
            issues += error.issues
    if issues:
        raise SpecError(issues)
    return CollectSpec(commands=tuple(found), on_fail=on_fail)  # type: ignore[arg-type]


def _unknown_terms(command: Mapping[str, Any], path: str) -> Iterator[SpecIssue]:
    """The predicates of a command that there are not."""
    for key in ("if", "success"):
        spec = command.get(key)
        name = spec.get("term") if isinstance(spec, dict) else spec
        if isinstance(name, str):
            try:
                find("predicate", name)
            except PluginError as error:
                yield SpecIssue("", f"{path}.{key}.term", str(error))


async def wait(workspace: Workspace, args: Wait) -> Answer:
    """Let simulated time pass while the robots hold what they have.

    Until things have come to rest, or a task's success has held for as long as it must.
    """
    entry = workspace.entry(args.session)

    def job(agent: Any) -> dict[str, Any]:
        env, ids = agent.env, agent.numbers(args.envs)
        steps = max(1, round(args.seconds / env.engine.world.physics.control_dt))
        made = 0
        for _ in range(steps):
            now = ids[env.running[ids]]
            if len(now) == 0:
                break
            action = agent.live.rest(now)
            env.step(action, agent.mask(now))
            for i in now.tolist():
                agent.histories[i].add(env, i, action[i], {})
            made += 1
        rows = [{"env": i, "status": str(env.status[i]), "success": agent.terms(i)} for i in ids.tolist()]
        return {"steps": made, "seconds": made * env.engine.world.physics.control_dt, "envs": rows}

    return Answer(await workspace.do(entry, job, changes=True))


async def cancel(workspace: Workspace, args: OfSession) -> Answer:
    """Give up the commands under way in a session.

    The robot holds where it is; the next command goes on from there.
    """
    ended = await workspace.cancel(workspace.entry(args.session))
    return Answer(
        {"cancelled": False, "why": "no commands are under way"} if ended is None else {"cancelled": True, **ended}
    )


TOOLS = (
    (run_skill, RunSkill, False),
    (run_command, RunCommand, False),
    (wait, Wait, False),
    (cancel, OfSession, False),
)
TELLS = (run_skill, run_command)
"""Tools that tell their progress."""
