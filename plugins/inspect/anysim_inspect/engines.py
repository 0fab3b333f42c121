"""Diagnosis of engines: what is installed, imports, falls, draws, and the remedy for what does not.

Each engine is tried in a process of its own (`anysim_inspect.engine_trial`), so that one that crashes, hangs or prints
costs nothing but its own findings.
"""

import json
from collections.abc import Iterable
from typing import NamedTuple

from anysim import registry
from anysim.engine.availability import Finding, Health
from anysim.errors import AnysimError
from anysim_processes.own_process import run_module

TIMEOUT_S = 180.0
"""Longest time [s] of a trial. SAPIEN's first image takes half a minute with some drivers in software."""


class Examination(NamedTuple):
    """The findings of one engine, and whether it steps a world with dynamics as physics says."""

    findings: tuple[Finding, ...]
    works: bool


def examine(name: str, timeout: float = TIMEOUT_S) -> Examination:
    """Try an installed engine. Never raises because of the engine."""
    head = f"engine: {name}"
    from anysim.engine.factory import availability  # which imports the engine's contract, and that this

    try:
        here = availability(name)
    except AnysimError as error:
        return _failed(head, Health.BROKEN, str(error), registry.remedy(_package(name)))
    if not here.available:
        return _failed(head, Health.UNAVAILABLE, "; ".join(here.missing), here.remedy)
    installed = Finding(head, Health.OK, f"{here.version}, of {_package(name)}")
    tried = _try_apart(name, timeout)
    return Examination((installed, *tried.findings), tried.works)


def _failed(what: str, state: Health, found: str, remedy: str) -> Examination:
    return Examination((Finding(what, state, found, remedy),), False)


def _package(name: str) -> str:
    try:
        return registry.distribution("engines", name)
    except AnysimError:
        return "the package it comes from"


def _try_apart(name: str, timeout: float) -> Examination:
    """The trial in its own process; its death or silence is a finding."""
    what = f"{name}: physics"
    ended = run_module("anysim_inspect.engine_trial", name, limit=timeout)
    findings, works = _read(ended.out.splitlines())
    trouble = ended.trouble or ("" if findings else "ended without a finding")
    if trouble:
        words = "; ".join(["the process " + trouble, *ended.err.strip().splitlines()[-3:]])[-300:]
        died = Finding(
            what if not findings else f"{name}: rendering",
            Health.BROKEN,
            words,
            registry.remedy(_package(name))
            if not findings
            else "look at the graphics driver; physics does not need it",
        )
        findings = (*findings, died)
    return Examination(findings, works)


def _read(lines: Iterable[str]) -> tuple[tuple[Finding, ...], bool]:
    """What a trial printed: a JSON document in each line. Lines that the engine's libraries print are passed over."""
    findings: list[Finding] = []
    works = False
    for line in lines:
        try:
            document = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(document, dict) and document.keys() >= {"what", "state", "found", "remedy", "works"}:
            works |= bool(document.pop("works"))
            findings.append(Finding(document["what"], Health(document["state"]), document["found"], document["remedy"]))
    return tuple(findings), works
