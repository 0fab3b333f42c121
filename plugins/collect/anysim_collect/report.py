"""Reports: `report.json` and `report.html` in the directory of a run, whole or not at all."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from anysim.errors import RecordError
from anysim.planning.service import PlannerService
from anysim.record.commit import write_whole
from anysim_collect.tally import Tally

FORMAT = "anysim-report-1"
REPORT_FILE, PAGE_FILE = "report.json", "report.html"


def report_of(
    run: dict[str, Any], tally: Tally, parts: dict[str, float], cpu_s: float, planners: Sequence[PlannerService] = ()
) -> dict[str, Any]:
    """A report as plain data.

    Args:
        run: what was run: task, engine, seed, envs.
        tally: what became of its episodes.
        parts: wall seconds by part; resumed episodes took none.
        cpu_s: CPU seconds of the process.
        planners: that planned moves; their own CPU seconds are told apart.
    """
    fresh = tally.kept - tally.resumed
    planning = planned(planners)
    cpu_s -= sum(service.counts.processor for service in planners if not service.beside)
    return {
        "format": FORMAT,
        **run,
        **tally.to_dict(),
        "cpu_s": cpu_s,
        "cpu_s_per_kept": cpu_s / fresh if fresh > 0 else None,
        "wall_s": parts,
        "planning": planning,
        "mixture": {},
    }


def mixed(reports: Sequence[dict[str, Any]], shares: Sequence[float], balance: str) -> dict[str, Any]:
    """What each of several tasks was to have, its share of the episodes, and what it got; empty for one task.

    Args:
        reports: one for each task.
        shares: of the episodes, for each.
        balance: what the shares are to balance.
    """
    if len(reports) == 1:
        return {}
    tasks = [
        {"task": report["task"], "engine": report["engine"], "share": share}
        | {key: report[key] for key in ("attempts", "kept", "segments")}
        | {"cpu_s": report["cpu_s"] + report["planning"].get("CPU [s]", 0.0)}
        for report, share in zip(reports, shares, strict=True)
    ]
    return {"balance": balance, "tasks": tasks}


MIXTURE_COLUMNS = ("task", "share", "episodes", "trajectories", "segments", "CPU s")


def mixture_rows(mixture: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """A row for each task, with the shares of all in brackets."""
    tasks = mixture.get("tasks", ())
    totals = {key: sum(one[key] for one in tasks) or 1 for key in ("attempts", "kept", "segments", "cpu_s")}
    return [
        (
            one["task"],
            f"{one['share']:.1%}",
            *(f"{one[key]:,.4g} ({one[key] / total:.1%})" for key, total in totals.items()),
        )
        for one in tasks
    ]


def planned(planners: Sequence[PlannerService]) -> dict[str, float]:
    """What planners have counted together; empty where nothing is planned."""
    counts = [service.counts for service in planners]
    if not counts:
        return {}
    return {
        "requests": sum(count.submitted for count in counts),
        "answered": sum(count.answered for count in counts),
        "cancelled": sum(count.cancelled for count in counts),
        "waited for": sum(count.late for count in counts),
        "waited [s]": sum(count.waited for count in counts),
        "workers lost": sum(count.lost_workers for count in counts),
        "CPU [s]": sum(count.processor for count in counts),
    }


def write_report(out: Path, report: dict[str, Any]) -> Path:
    """Write both files; returns the page.

    Raises:
        RecordError: they cannot be written.
    """
    from anysim_collect.page import page

    text = json.dumps(report, indent=2, sort_keys=True) + "\n"
    write_whole(out, {REPORT_FILE: text, PAGE_FILE: page(report)})
    return out / PAGE_FILE


def read_reports(out: Path) -> dict[Path, dict[str, Any]]:
    """The report of a run, or those of the tasks of a mixture, by directory.

    Raises:
        RecordError: there is none, or it is none of ours.
    """
    below = sorted(path.parent for path in out.glob(f"*/{REPORT_FILE}"))
    return {place: read_report(place) for place in ([out] if (out / REPORT_FILE).exists() else below or [out])}


def read_report(out: Path) -> dict[str, Any]:
    """The report of a run.

    Raises:
        RecordError: there is none, or it is none of ours.
    """
    path = out / REPORT_FILE
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RecordError(f"{path} is not there; `anysim run` writes it when a run has ended") from None
    except (OSError, ValueError) as error:
        raise RecordError(f"{path} cannot be read: {error}; run the same command again to write it anew") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise RecordError(f"{path} is no report of the format {FORMAT}; run the same command again to write it anew")
    return data
