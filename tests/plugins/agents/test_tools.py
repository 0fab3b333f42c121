"""Tools of agents, called from Python: what they answer, what they refuse and how, and how commands end."""

import asyncio
import io
import json
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from PIL import Image

import anysim
from anysim.skills.runner import SkillPolicy
from anysim_agents.tools import TOOLS, definitions
from tests.plugins.agents.helpers import AGENT, LONG, SERVICE, Caller, replace, used

# ------------------------------------------------------------------ definitions


def test_definitions_are_the_same_tools_in_each_form() -> None:
    forms = {style: definitions(style) for style in ("mcp", "openai", "anthropic")}
    schemas = [
        {one["name"]: one["inputSchema"] for one in forms["mcp"]},
        {one["function"]["name"]: one["function"]["parameters"] for one in forms["openai"]},
        {one["name"]: one["input_schema"] for one in forms["anthropic"]},
    ]
    assert schemas[0] == schemas[1] == schemas[2]
    assert list(schemas[0]) == list(TOOLS)
    for name, schema in schemas[0].items():
        Draft202012Validator.check_schema(schema)
        assert schema["type"] == "object", name
        assert schema["additionalProperties"] is False, name
        assert "$ref" not in json.dumps(schema), name
    longest = max(len(values) for schema in schemas[0].values() for values in _enumerations(schema))
    assert longest <= 10
    assert len(json.dumps(forms["mcp"])) < 25_000  # a model reads all of it each time


def _enumerations(schema: Any) -> list[list[Any]]:
    if isinstance(schema, dict):
        own = [schema["enum"]] if "enum" in schema else []
        return own + [found for value in schema.values() for found in _enumerations(value)]
    return [found for value in schema for found in _enumerations(value)] if isinstance(schema, list) else []


# ------------------------------------------------------------------ wrong input

WRONG: list[tuple[str, dict[str, Any], tuple[str, ...]]] = [
    ("nothing", {}, ("no tool 'nothing'", "list_catalog")),
    ("observ", {}, ("did you mean 'observe'",)),
    ("observe", {"session": "s1", "enf": 0}, ("observe.enf: unknown key; did you mean 'env'?",)),
    ("observe", {"session": "s1", "env": 2}, ("envs 0 to 1, got 2",)),
    ("observe", {"session": "s9"}, ("no 's9' (there are: s1)", "create_session")),
    ("observe", {}, ("observe.session: this key is required",)),
    ("create_session", {"task": "blokcs"}, ("'blokcs' is not served", "blocks")),
    ("create_session", {"engine": "mujocco"}, ("no 'mujocco'", "mujoco")),
    ("create_session", {"num_envs": 900}, ("at most 16 envs, asked for 900",)),
    ("create_session", {"horizon": 10**9}, ("at most 100000",)),
    ("create_session", {"task": "../blocks.yaml"}, ("is not served",)),
    ("list_catalog", {"kind": "task"}, ("list_catalog.kind", "'tasks'")),
    ("describe", {"kind": "command", "name": "pik"}, ("no command 'pik'; did you mean 'pick'?",)),
    ("describe", {"kind": "yaml", "name": "world.objekts"}, ("did you mean 'objects'?", "robots")),
    ("render", {"session": "s1"}, ("null draws nothing", "another engine")),
    ("look_at", {"session": "s1", "target": "red", "distance": 0}, ("look_at.distance", "greater than 0.02")),
    ("run_skill", {"session": "s1", "skill": "wach"}, ("run_skill.skill: there is no command 'wach'", "'watch'")),
    ("run_skill", {"session": "s1", "skill": "watch", "parameters": {"target": "rd"}}, ("parameters.target", "'red'")),
    ("run_skill", {"session": "s1", "skill": "watch", "parameters": {"stps": 3}}, ("'steps'?", "watch takes: target")),
    ("run_skill", {"session": "s1", "skill": "watch", "parameters": "{steps: 1"}, ("run_skill.parameters",)),
    ("run_skill", {"session": "s1", "skill": "watch", "envs": [0, 5]}, ("envs 0 to 1, got 5",)),
    ("run_skill", {"session": "s1", "skill": "watch", "envs": [0, 0]}, ("each env once",)),
    ("run_command", {"session": "s1", "commands": []}, ("run_command.commands",)),
    ("run_command", {"session": "s1", "commands": [{"skill": "watch"}]}, ("commands.0: a command is", "{do: pick")),
    ("run_command", {"session": "s1", "commands": ["watch"] * 21}, ("at most 20 at once, got 21",)),
    (
        "run_command",
        {"session": "s1", "commands": ["watch", {"do": "watch", "if": {"term": "nearr"}}]},
        ("commands.1", "did you mean 'near'?"),
    ),
    ("reset_to", {"session": "s1", "snapshot": "snapshot_7"}, ("no 'snapshot_7' (there are: none", "`snapshot`")),
    ("reset", {"session": "s1", "changes": {"objects.red.mas": 1}}, ("did you mean 'objects.red.mass'?",)),
    ("reset", {"session": "s1", "changes": {"objects.red.mass": -1}}, ("cannot be -1",)),
    ("counterfactual", {"session": "s1", "changes": {}}, ("at least one value", "can_change")),
    ("counterfactual", {"session": "s1", "changes": {"objects.red.mass": 1}}, ("nothing has been done since then",)),
    ("ask", {"session": "s1", "about": "questions", "thing": "rd"}, ("no 'rd' (things: ball, red, table)",)),
    ("ask", {"session": "s1", "about": "questions", "family": "x"}, ("'x' can be asked", "support")),
    (
        "propose_layout",
        {"session": "s1", "poses": {"rd": {"position": [0, 0, 1]}}},
        ("propose_layout.poses.rd", "did you mean 'red'?"),
    ),
    ("propose_layout", {"session": "s1", "poses": {"red": {"position": [0, 0]}}}, ("poses.red.position",)),
]


def test_wrong_input_is_answered_with_a_sentence_that_repairs_it() -> None:
    async def scenario(tool: Caller) -> None:
        await tool("create_session", num_envs=2, seed=1)
        before = await tool("observe", session="s1")
        for name, arguments, parts in WRONG:
            words = await tool.refused(name, **arguments)
            for part in parts:
                assert part in words, (name, arguments, words)
            assert "Traceback" not in words
        assert await tool("observe", session="s1") == before  # nothing of it has changed anything
        assert [one["session"] for one in (await tool("status"))["sessions"]] == ["s1"]

    used(scenario)


def test_arguments_may_come_as_text() -> None:
    async def scenario(tool: Caller) -> None:
        await tool("create_session")
        found = await tool("run_skill", session="s1", skill="watch", parameters='{"steps": 3}', envs="[0]")
        assert (found["ok"], found["envs"][0]["steps"]) == (True, 2)  # it has ended before the third

    used(scenario)


# ------------------------------------------------------------------ commands


def test_commands_end_are_cancelled_and_refuse_others_meanwhile() -> None:
    forever = {"skill": "watch", "parameters": {"steps": 90_000, "least": 90_000, "target": "red"}}

    async def scenario(tool: Caller) -> None:
        await tool("create_session", num_envs=2)
        assert (await tool("cancel", session="s1"))["cancelled"] is False
        begun = await tool("run_skill", session="s1", wait=0, **forever)
        assert begun["done"] is False
        assert "under way" in await tool.refused("reset", session="s1")
        assert "under way" in await tool.refused("run_skill", session="s1", skill="watch")
        assert (await tool("observe", session="s1"))["doing"]["skill"] == "commands"  # looking is free
        told = await tool("status", session="s1")
        assert told["commands"]["done"] is False
        ended = await tool("cancel", session="s1")
        assert [one["outcome"] for one in ended["envs"]] == ["cancelled", "cancelled"]
        assert "goes on from there" in ended["envs"][0]["advice"]
        assert (await tool("status", session="s1"))["commands"]["envs"] == ended["envs"]
        after = await tool("run_skill", session="s1", skill="watch", parameters={"steps": 2}, envs=[1])
        assert [(one["env"], one["outcome"], one["steps"]) for one in after["envs"]] == [(1, "ok", 1)]

        call = asyncio.create_task(tool("run_skill", session="s1", **forever))  # as a client that goes away
        await asyncio.sleep(0.05)
        call.cancel()
        await asyncio.gather(call, return_exceptions=True)
        while not (await tool("status", session="s1"))["commands"].get("done"):
            await asyncio.sleep(0.01)
        assert (await tool("status", session="s1"))["commands"]["envs"][0]["outcome"] == "cancelled"

        await tool("run_skill", session="s1", wait=0, **forever)
        await tool("end_session", session="s1")  # with commands under way
        assert "create_session" in await tool.refused("observe", session="s1")

    used(scenario)


def test_a_command_tells_how_it_failed_and_an_episode_that_it_ended() -> None:
    async def scenario(tool: Caller) -> None:
        await tool("create_session", horizon=30)
        late = await tool("run_skill", session="s1", skill="watch", parameters={"steps": 99}, timeout=0.1)
        assert (late["ok"], late["envs"][0]["outcome"], late["envs"][0]["at"]) == (False, "timeout", "1 watch: watch")
        assert late["envs"][0]["advice"]
        over = await tool("run_skill", session="s1", skill="watch", parameters={"steps": 99, "least": 99})
        assert over["envs"][0]["outcome"] == "episode truncated"
        assert "horizon" in over["envs"][0]["advice"]
        words = await tool.refused("run_skill", session="s1", skill="watch")
        assert "have ended" in words
        assert "call reset" in words
        await tool("reset", session="s1")
        checks = [
            {"do": "watch", "steps": 2, "if": {"term": "near", "a": "red", "b": "ball", "tolerance": 0.001}},
            {"do": "watch", "steps": 2, "success": {"term": "near", "a": "red", "b": "ball", "tolerance": 0.001}},
        ]
        failed = await tool("run_command", session="s1", commands=checks)
        assert (failed["envs"][0]["outcome"], failed["envs"][0]["at"]) == ("lost", "2 watch: watch")

    used(scenario)


# ------------------------------------------------------------------ a robot at work


def test_an_arm_is_commanded_looked_at_put_back_and_asked_about() -> None:
    """One session of a real task for all that needs an engine with physics."""

    async def scenario(tool: Caller) -> None:
        began = await tool("create_session", seed=3, on_success="continue", horizon=1500)
        assert began["cameras"] == ["front", "wrist"]
        image = await tool.answer("look_at", session="s1", target="cube", distance=0.4, width=96, height=64)
        drawn = Image.open(io.BytesIO(image.images[0]))
        assert (drawn.format, drawn.size) == ("PNG", (96, 64))
        assert len(np.unique(np.asarray(drawn).reshape(-1, 3), axis=0)) > 20
        seen = (await tool.answer("render", session="s1", camera="front", width=96, height=64)).images
        assert seen == (await tool.answer("render", session="s1", camera="front", width=96, height=64)).images
        held = await tool("run_skill", session="s1", skill="grasp", parameters={"object": "cube"})
        assert held["ok"], held
        kept = (await tool("snapshot", session="s1"))["snapshot"]
        lift = {
            "session": "s1",
            "commands": [{"do": "lift", "object": "cube"}, {"do": "bring", "object": "cube", "goal": "goal"}],
        }
        assert (await tool("run_command", **lift))["ok"]
        once = await tool("observe", session="s1")
        story = (await tool("ask", session="s1", about="story"))["story"]
        assert any("lifts" in one["text"] for one in story), story
        otherwise = await tool("counterfactual", session="s1", changes={"objects.cube.mass": 1.5})
        assert otherwise["diverges_at_step"] is not None
        assert otherwise["things"]
        assert await tool("observe", session="s1") == once  # as it was
        await tool("reset_to", session="s1", snapshot=kept)
        again = await tool("run_command", **lift)
        assert again["ok"], again
        assert await tool("observe", session="s1") == once  # what the hand held it went on to hold
        ground = await tool("ask", session="s1", about="questions", family="support", most=50)
        assert {one["family"] for one in ground["questions"]} <= {"support"}

    used(scenario, "pick_cube")


@pytest.mark.slow
def test_commands_that_are_given_do_what_those_of_a_file_do_to_the_bit() -> None:
    """The commands of a task, given from outside, are the episode that `anysim run` makes of it."""
    commands = [dict(one) for one in anysim.load("put_away").data["collect"]["commands"]]

    async def scenario(tool: Caller) -> tuple[list[Any], list[Any]]:
        await tool("create_session", seed=5)
        for command in commands:  # one at a time, with other calls between them
            await tool("run_command", session="s1", commands=[command])
            await tool("observe", session="s1")
        entry = tool.space.entry("s1")
        return await tool.space.do(entry, lambda agent: (agent.histories[0].actions, agent.histories[0].poses))

    actions, poses = used(scenario, "put_away")
    with anysim.make("put_away", num_envs=1, seed=5) as env:
        env.reset()
        policy, everyone = SkillPolicy(env), np.arange(1)
        policy.begin(everyone)
        for number, action in enumerate(actions):
            own = policy.act(everyone)
            assert (own[0] == action).all(), number
            env.step(own)
            assert (env.engine.get_state().body_pose[0] == poses[number + 1]).all(), number
        assert len(actions) > 300


# ------------------------------------------------------------------ layouts


def test_a_layout_is_proposed_kept_or_refused_without_a_trace() -> None:
    async def scenario(tool: Caller) -> None:
        await tool("create_session", num_envs=2, seed=1)
        other = await tool("observe", session="s1", env=1)
        told = (await tool("propose_layout", session="s1"))["request"]
        assert {thing["name"] for thing in told["things"]} == {"table", "red", "ball"}
        poses = {"red": {"position": [0.2, -0.1, 0.425], "yaw": 0.5}}
        found = await tool("propose_layout", session="s1", poses=poses, reason="near the edge")
        assert found["placed"]["red"]["moved_by"] == pytest.approx(0.0, abs=1e-6)
        assert found["by_the_layout"] == "table, ball"
        placed = await tool("observe", session="s1")
        assert placed["things"]["red"]["position"] == [0.2, -0.1, 0.425]
        words = await tool.refused("propose_layout", session="s1", poses={"red": {"position": [5.0, 0.0, 0.425]}})
        assert "red" in words
        assert await tool("observe", session="s1") == placed
        assert await tool("observe", session="s1", env=1) == other
        await tool("reset", session="s1", seed=1, envs=[0])
        first = await tool("observe", session="s1")
        with anysim.make(LONG, num_envs=1) as env:  # without any proposal, episodes are those of everyone else
            env.reset(seed=1)
            index = [entity.name for entity in env.engine.world.entities].index("red")
            pose = env.engine.get_state().body_pose[0, env.engine.world.entities[index].root]
        assert first["things"]["red"]["position"] == np.round(pose[:3], 4).tolist()

    used(scenario)


# ------------------------------------------------------------------ sessions and limits


def test_sessions_are_limited_expire_and_are_not_guessed() -> None:
    async def scenario(tool: Caller) -> None:
        one, two = await tool("create_session"), await tool("create_session")
        assert len(one["session"]) > 16
        assert one["session"][3:] != two["session"][3:]
        words = await tool.refused("create_session")
        assert "there are 2 sessions, which is the most" in words
        assert "there is no 's1'" in await tool.refused("observe", session="s1")
        assert (await tool("status"))["sessions"] == []  # of others nothing is told
        tool.space.sessions.limits = replace(tool.space.sessions.limits, idle_s=0.0)
        await asyncio.sleep(0.01)
        tool.space.sessions.sweep()
        assert "create_session" in await tool.refused("observe", session=one["session"])
        assert not tool.space.sessions.open

    used(scenario, limits=replace(SERVICE, sessions=2), shared=True)


def test_snapshots_and_images_are_limited() -> None:
    async def scenario(tool: Caller) -> None:
        await tool("create_session")
        for number in (1, 2, 3):
            assert (await tool("snapshot", session="s1"))["snapshot"] == f"snapshot_{number}"
        assert (await tool("status", session="s1"))["snapshots"] == ["snapshot_2", "snapshot_3"]
        assert "the 2 last ones are kept" in await tool.refused("reset_to", session="s1", snapshot="snapshot_1")

    used(scenario, agent=replace(AGENT, snapshots=2))


def test_every_page_of_the_catalogue_is_short() -> None:
    async def scenario(tool: Caller) -> None:
        for kind in ("tasks", "robots", "engines", "commands", "predicates", "assets", "planners", "sensors"):
            page = await tool("list_catalog", kind=kind)
            assert page["entries"], kind
            assert len(page["entries"]) <= AGENT.page
            names = [entry["name"] for entry in page["entries"]]
            while "next" in page:
                page = await tool("list_catalog", kind=kind, start=len(names))
                names += [entry["name"] for entry in page["entries"]]
            assert len(names) == len(set(names)) == page["found"]
        for name in ("pick", "open", "goto"):
            told = await tool("describe", kind="command", name=name)
            assert not {"bank", "living", "insertions"} & set(told["parameters"])
        assert "procedural" in (await tool("describe", kind="asset", name="cabinet"))["use"]
        assert (await tool("describe", kind="robot", name="franka_panda"))["tools"] == ["tool"]
        assert (await tool("describe", kind="engine", name="null"))["available"] is True
        assert (await tool("describe", kind="predicate", name="near"))["parameters"]["tolerance"]["required"] is True
        assert (await tool("describe", kind="task", name="blocks"))["objects"] == ["table", "red", "ball"]

    used(scenario)
