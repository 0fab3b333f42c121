"""Policies from files: a YAML description and the model that it names."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.assets.uri import locate
from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim.errors import AssetError, SpecError, TaskError, listing
from anysim_policy.layout import Layout
from anysim_policy.runtimes import load_model
from anysim_policy.spec import PolicySpec


class FilePolicy:
    """The policy of a YAML file (`anysim_policy.spec.PolicySpec`).

    Attributes:
        spec: what the file says.
        layout: what the policy observes.
    """

    def __init__(
        self,
        channel: ChannelView,
        *,
        file: Annotated[str, Field(description="the policy's YAML: `package:NAME/walk.yaml` or an absolute path")],
    ) -> None:
        from anysim_schemas.load import load

        try:
            found = locate(file)
            self.spec = load(PolicySpec, found.path).spec
            model = locate(self.spec.model, base=found.path.parent)
        except (AssetError, SpecError) as error:
            raise TaskError(f"the policy '{file}': {error}") from None
        if not self.spec.model.startswith("package:") and not model.path.is_relative_to(found.path.parent):
            known = listing(sorted(p.name for p in found.path.parent.iterdir()), 10)
            raise TaskError(f"the policy '{file}': its model must be in the folder of the file (there: {known})")
        self.layout = Layout(self.spec, channel)
        self._model = load_model(model.path, self.layout.size, len(self.layout.joints))

    def act(self, observation: Array) -> Array:
        """The output (E, A) for observations (E, D) float32, row by row."""
        rows = np.empty((len(observation), len(self.layout.joints)))
        for number, row in enumerate(observation):
            rows[number] = self._model(np.ascontiguousarray(row))
        return rows
