"""Input devices by name, with options as they are written on the command line."""

from collections.abc import Sequence
from typing import Any

import yaml
from pydantic import ValidationError

from anysim import registry
from anysim.errors import AnysimError, PluginError, listing
from anysim.plugin_parameters import options_model, parameters
from anysim_teleop.device import InputDevice


def make_device(name: str, options: Sequence[str] = ()) -> InputDevice:
    """A device by its installed name; options are texts such as `port=8080`.

    Raises:
        PluginError: no such device is installed, or it is no InputDevice.
        AnysimError: an option is unknown or wrong; lists those that there are.
    """
    made: Any = registry.load("devices", name)
    package = registry.distribution("devices", name)
    if not (isinstance(made, type) and issubclass(made, InputDevice)):
        raise PluginError(
            f"the device '{name}' of {package} is no class derived from anysim_teleop.device.InputDevice; "
            f"{registry.remedy(package)}"
        )
    known, given = parameters(made), {}
    for text in options:
        key, equals, value = text.partition("=")
        if not equals or key not in known:
            raise AnysimError(
                f"device '{name}': '{text}' is none of its options, written KEY=VALUE "
                f"(options: {listing(list(known)) if known else 'none'})"
            )
        given[key] = value if known[key].annotation is str else _value(name, text, value)
    try:
        values = options_model(made).model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise AnysimError(f"device '{name}': option {key}: {first['msg']}; pass it as -D {key}=VALUE") from None
    with registry.using("devices", name):
        return made(**dict(values))


def _value(name: str, text: str, value: str) -> Any:
    try:
        return yaml.safe_load(value)
    except yaml.YAMLError:
        raise AnysimError(f"device '{name}': the value of '{text}' cannot be read; quote it as YAML") from None
