"""Benchmark of vla-eval whose tasks are those of anysim; its harness imports it by its name."""

from typing import Any

from vla_eval.benchmarks.base import StepBenchmark, StepResult  # pyright: ignore[reportMissingImports]
from vla_eval.specs import IMAGE_RGB, LANGUAGE, DimSpec  # pyright: ignore[reportMissingImports]

from anysim_adapters.vla_eval.tasks import EvalTasks


class AnysimBenchmark(StepBenchmark):
    """Tasks of anysim, one env each; success is the task's own verdict.

    It has no action that is safe to repeat while a model thinks (what an action means is the task's), so the harness
    refuses it in its live mode.
    """

    def __init__(self, tasks: Any, **options: Any) -> None:
        """`options` are those of `EvalTasks`: engine, overrides, split, first, privileged."""
        super().__init__()
        self._tasks = EvalTasks(tasks, **options)

    def get_tasks(self) -> list[dict[str, Any]]:
        return [{"name": name, "suite": "anysim"} for name in self._tasks.names]

    def reset(self, task: dict[str, Any]) -> dict[str, Any]:
        return self._tasks.reset(task["name"], int(task.get("episode_idx", 0)))

    def step(self, action: dict[str, Any]) -> Any:
        stepped = self._tasks.step(action)
        self._recorder.record_step(reward=stepped.reward, done=stepped.done, success=self._tasks.result()["success"])
        return StepResult(stepped.obs, stepped.reward, stepped.done, {"status": stepped.status})

    def make_obs(self, raw_obs: dict[str, Any], task: dict[str, Any]) -> dict[str, Any]:
        return raw_obs

    def get_step_result(self, step_result: Any) -> dict[str, Any]:
        return self._tasks.result()

    async def get_time(self) -> float:
        return self._tasks.seconds()

    def get_metadata(self) -> dict[str, Any]:
        return {"max_steps": self._tasks.horizon()}

    def get_action_spec(self) -> dict[str, Any]:
        low, high = self._tasks.env.action_bounds
        labels = ", ".join(map(str, self._tasks.env.action_spaces.labels))
        return {"action": DimSpec("action", len(low), "raw", (float(low.min()), float(high.max())), None, labels)}

    def get_observation_spec(self) -> dict[str, Any]:
        env = self._tasks.env
        found = {"language": LANGUAGE}
        if any(len(shape) == 3 for shape in env.image_shapes.values()):
            found["image"] = IMAGE_RGB
        if "policy" in env.observation_sizes:
            found["state"] = DimSpec("state", env.observation_sizes["policy"], "raw")
        return found

    def cleanup(self) -> None:
        self._tasks.close()
