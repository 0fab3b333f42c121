"""The learner `clone`: behaviour cloning of recorded runs, by a perceptron or by a transformer of action chunks.

The chunks follow Zhao et al. 2023 (ACT) without its latent variable.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from anysim.errors import TaskError
from anysim_learning.demonstrations import Demonstrations, check_cameras
from anysim_learning.learner import Lesson
from anysim_schemas.base import Positive

if TYPE_CHECKING:
    import torch  # pyright: ignore[reportMissingImports]

    from anysim_learning.networks import Rows

STRETCH = 100
"""Steps of descent between two numbers of the curve."""
_AT_ONCE = 1024


class Clone:
    """Regression from observations to the actions that followed, with the least mean absolute error.

    Images of the task are observations too, each camera with an encoder of its own.
    """

    default_steps = 20_000
    needs = ("torch", "tensorboard", "onnx")
    sees_images = True

    def __init__(
        self,
        lesson: Lesson,
        *,
        model: Annotated[Literal["mlp", "transformer"], Field(description="the network")] = "mlp",
        chunk: Annotated[int, Field(ge=1, description="actions that are given at once")] = 8,
        carried_out: Annotated[int, Field(ge=0, description="of them before it is asked again; 0: all")] = 0,
        width: Annotated[int, Field(ge=8)] = 256,
        layers: Annotated[int, Field(ge=1)] = 3,
        batch_size: Annotated[int, Field(ge=1)] = 256,
        learning_rate: Positive = 1e-3,
        weight_decay: Annotated[float, Field(ge=0)] = 1e-4,
        noise: Annotated[float, Field(ge=0, description="added to observations, in their deviations")] = 0.02,
        average: Annotated[
            float, Field(ge=0, lt=1, description="how much of the mean weights each step keeps")
        ] = 0.998,
        shift: Annotated[int, Field(ge=0, description="pixels by which images are moved at random")] = 2,
        held_out: Annotated[float, Field(gt=0, lt=1, description="share of trajectories for validation")] = 0.1,
    ) -> None:
        import torch  # pyright: ignore[reportMissingImports]
        from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn  # pyright: ignore[reportMissingImports]

        from anysim_learning.images import Eye, Seeing, reduced, reduction
        from anysim_learning.networks import Mlp, Policy, Transformer

        if not lesson.data:
            raise TaskError("the learner 'clone' learns from recorded runs; name them with --data RUN")
        env = lesson.env
        shapes = {name: env.image_shapes[name] for name in lesson.images}
        check_cameras(lesson.data, shapes, env.capture.observed)
        data = Demonstrations(
            lesson.data,
            lesson.groups,
            chunk,
            images=lesson.images,
            prepare=lambda images: reduced(images, reduction(*images.shape[1:3])),
        )
        if data.trajectories[0].action.shape[1] != lesson.env.action_dim:
            raise TaskError(
                f"the runs command {data.trajectories[0].action.shape[1]} actions, '{lesson.env.name}' has "
                f"{lesson.env.action_dim}; record them with this task and robot"
            )
        order = np.random.default_rng(lesson.seed).permutation(len(data.trajectories))
        apart = max(1, round(held_out * len(order))) if len(order) > 1 else 0
        self._train = self._samples(data, order[apart:].tolist(), lesson)
        self._held_out = self._samples(data, order[:apart].tolist(), lesson) if apart else None
        torch.manual_seed(lesson.seed)
        obs = self._train.obs
        eyes = [Eye(*(side // reduction(*shape[:2]) for side in shape[:2])) for shape in shapes.values()]
        size = obs.shape[1] + sum(eye.size for eye in eyes)
        body = (Mlp if model == "mlp" else Transformer)(size, env.action_dim, chunk, width, layers)
        body = Seeing(body, eyes) if eyes else body
        self._body, self._mean = body, AveragedModel(body, multi_avg_fn=get_ema_multi_avg_fn(average))
        self._network = Policy(self._mean.module, obs.mean(0), obs.std(0).clamp(min=1e-3), lesson, carried_out or chunk)
        self.chunk = carried_out or chunk
        self._optimizer = torch.optim.AdamW(body.parameters(), lr=learning_rate, weight_decay=weight_decay)
        self._rate, self._batch_size, self._noise, self._shift = learning_rate, batch_size, noise, shift
        self._draws = torch.Generator().manual_seed(lesson.seed)
        self.steps = 0

    @staticmethod
    def _samples(data: Demonstrations, chosen: list[int], lesson: Lesson) -> "Rows":
        from anysim_learning.networks import Rows

        return Rows(data.arrays(chosen), data.frames(chosen), lesson)

    def advance(self) -> Mapping[str, float]:
        """Some steps of descent; the rate falls with the square root of how far it is."""
        import torch  # pyright: ignore[reportMissingImports]

        from anysim_learning.images import shifted
        from anysim_learning.networks import error

        total = 0.0
        for _ in range(STRETCH):
            for group in self._optimizer.param_groups:
                group["lr"] = self._rate / (1 + self.steps / 2_000) ** 0.5
            rows = torch.randint(len(self._train.obs), (self._batch_size,), generator=self._draws)
            obs = self._network.normal(self._train.obs[rows])
            obs = obs + self._noise * torch.randn(obs.shape, generator=self._draws)
            images = [shifted(seen, self._shift, self._draws) for seen in self._train.images(rows)]
            loss = error(self._body(obs, *images), self._train.action[rows], self._train.mask[rows])
            self._optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self._body.parameters(), 1.0)
            self._optimizer.step()
            self._mean.update_parameters(self._body)
            total += float(loss.item())
            self.steps += 1
        numbers = {"loss": total / STRETCH}
        if self._held_out is not None:
            numbers["held_out_loss"] = self._error(self._held_out)
        return numbers

    def _error(self, samples: "Rows") -> float:
        """Of the mean weights, in samples that nothing is done to."""
        import torch  # pyright: ignore[reportMissingImports]

        from anysim_learning.networks import error

        with torch.inference_mode():
            given = [
                self._network.body(self._network.normal(samples.obs[rows]), *samples.images(rows))
                for rows in torch.arange(len(samples.obs)).split(_AT_ONCE)
            ]
            return float(error(torch.cat(given), samples.action, samples.mask).item())

    def state(self) -> dict[str, Any]:
        """Weights and their mean, the optimiser's moments, the generator, and how far it is."""
        return {
            "body": dict(self._body.state_dict()),
            "mean": dict(self._mean.state_dict()),
            "optimizer": self._optimizer.state_dict(),
            "draws": self._draws.get_state(),
            "steps": self.steps,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from there, as if it had not been put away."""
        from anysim_learning.tensors import tensors

        self._body.load_state_dict(tensors(state["body"]))
        self._mean.load_state_dict(tensors(state["mean"]))
        self._optimizer.load_state_dict(tensors(state["optimizer"]))
        self._draws.set_state(tensors(state["draws"]))
        self.steps = int(state["steps"])

    def network(self) -> "torch.nn.Module":
        """From observations to chunks (n, K, A) in the units of the env, by the mean of the weights of late."""
        return self._network
