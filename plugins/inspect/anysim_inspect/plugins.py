"""Plugins that do not load, found in a process of their own: one that crashes or hangs there costs its own row.

Engines have their own examination (`anysim_inspect.engines`). The process, `python -m` with this module and a KIND/NAME
for each plugin, prints a JSON line as soon as one is known; the first one without a line is the one that ended it.
"""

import json
import sys

from anysim import registry
from anysim.engine.availability import Finding, Health
from anysim_processes.own_process import run_module

LIMIT_S = 120.0
"""Longest time [s] for all plugins together, and again for those behind one that crashed."""
OBSERVERS = "observers"


def broken() -> list[Finding]:
    """A row for each installed plugin that does not load: why, its distribution, and the remedy."""
    left = [f"{kind}/{name}" for kind in registry.KINDS if kind != "engines" for name in registry.names(kind)]
    left += [f"{OBSERVERS}/{registry.package_of(entry)}:{entry.name}" for entry in registry.observers()]
    found: list[Finding] = []
    while left:
        ended = run_module(__name__, *left, limit=LIMIT_S)
        told = _read(ended.out)
        found += [_finding(plugin, told[plugin]) for plugin in left if told.get(plugin)]
        left = [plugin for plugin in left if plugin not in told]
        if left:
            found.append(_finding(left.pop(0), f"the process {ended.trouble or 'ended'} while it loaded"))
    return found


def _finding(plugin: str, why: str) -> Finding:
    kind, _, name = plugin.partition("/")
    package = name.partition(":")[0] if kind == OBSERVERS else registry.first_package(kind, name)
    return Finding(f"{kind.removesuffix('s')}: {name}", Health.BROKEN, why, registry.remedy(package))


def _read(text: str) -> dict[str, str]:
    """What is wrong with each plugin, nothing where it loads. Lines that plugins print are passed over."""
    told: dict[str, str] = {}
    for line in text.splitlines():
        try:
            document = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(document, dict) and document.keys() == {"plugin", "wrong"}:
            told[str(document["plugin"])] = str(document["wrong"])
    return told


def _load(kind: str, name: str) -> None:
    if kind == "robots":
        from anysim.assets.catalogue import load_robot

        load_robot(name)
    elif kind == "tasks":
        from anysim.api import load, task_path

        load(task_path(name))
    elif kind == OBSERVERS:
        next(e for e in registry.observers() if f"{registry.package_of(e)}:{e.name}" == name).load()
    else:
        registry.load(kind, name)


def main(plugins: list[str]) -> None:
    """Load these, and say of each how it went."""
    for plugin in plugins:
        kind, _, name = plugin.partition("/")
        wrong = ""
        try:
            _load(kind, name)
        except BaseException as error:  # noqa: BLE001 - whatever a plugin does belongs into its row
            wrong = registry.in_words(error)
        sys.stdout.write(json.dumps({"plugin": plugin, "wrong": wrong}) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
