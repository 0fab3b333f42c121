"""Findings of `anysim doctor` about SAPIEN beyond its trial: Vulkan drivers that are here, and how to choose one."""

import os
from pathlib import Path

from anysim.engine.availability import Finding, Health
from anysim_sapien import vulkan


def findings() -> tuple[Finding, ...]:
    """The driver that `vulkan_icd: auto` takes, and the threads."""
    return (
        driver(),
        Finding("sapien: threads", Health.NOTE, "one per process, it keeps the interpreter's lock: `shards` uses more"),
    )


def driver() -> Finding:
    """The Vulkan driver that draws unless an option says otherwise."""
    what = "sapien: Vulkan driver"
    for variable in vulkan.VARIABLES:
        if path := os.environ.get(variable):
            if all(Path(part).is_file() for part in path.split(os.pathsep)):
                return Finding(what, Health.OK, f"{path}, by ${variable}")
            return Finding(what, Health.BROKEN, f"${variable} names {path}, which is not there", f"unset {variable}")
    system = [str(file) for folder in vulkan.SYSTEM for file in sorted(Path(folder).glob("*.json"))]
    if system:
        return Finding(what, Health.OK, f"the system's: {', '.join(system)}")
    found = vulkan.driver_file("auto")
    if not found:
        return Finding(
            what,
            Health.MISSING,
            "none in " + ", ".join((*vulkan.SYSTEM, *sorted(map(_folder, vulkan.SOFTWARE)))),
            vulkan.REMEDY,
        )
    return Finding(
        what,
        Health.OK,
        f"in software, {found}, found by itself",
        f"to name it: -o engine.options.vulkan_icd={found}, for other programs: export VK_ICD_FILENAMES={found}",
    )


def _folder(path: str) -> str:
    return str(Path(path).parent)
