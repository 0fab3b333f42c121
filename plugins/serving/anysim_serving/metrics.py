"""Metrics of a service, in the text format of Prometheus."""

from collections import Counter

from anysim_serving.sessions import Sessions


def exposition(sessions: Sessions) -> str:
    """Counts since the start and what there is now. Nothing of it names a client."""
    total = Counter(sessions.total)
    for session in sessions.open.values():
        total.update(session.counts)
    simulators = [session.simulator for session in sessions.open.values()]
    lines: list[str] = []

    def metric(name: str, kind: str, words: str, value: float, labels: str = "") -> None:
        if not any(line.startswith(f"# TYPE anysim_{name} ") for line in lines):
            lines.extend((f"# HELP anysim_{name} {words}", f"# TYPE anysim_{name} {kind}"))
        lines.append(f"anysim_{name}{labels} {value:g}")

    metric("sessions", "gauge", "Sessions now.", len(sessions.open))
    metric("sessions_attached", "gauge", "Of them, with a connection.", sum(s.attached for s in sessions.open.values()))
    metric("envs", "gauge", "Envs of all sessions now.", sum(s.num_envs for s in sessions.open.values()))
    metric("waiting", "gauge", "Operations that wait for their simulator.", sum(s.depth for s in simulators))
    metric(
        "busy_seconds",
        "gauge",
        "Seconds that simulators of today's sessions worked.",
        sum(s.busy_s for s in simulators),
    )
    metric("sessions_created_total", "counter", "Sessions so far.", total["created"])
    for name, words in (
        ("operations", "Operations so far."),
        ("errors", "Operations that ended in an error."),
        ("steps", "Control steps of single envs."),
        ("bytes_in", "Bytes of messages from clients."),
        ("bytes_out", "Bytes of messages to clients."),
    ):
        metric(f"{name}_total", "counter", words, total[name])
    for name, count in sorted(total.items()):
        if name.startswith("ended_"):
            label = f'{{why="{name.removeprefix("ended_")}"}}'
            metric("sessions_ended_total", "counter", "Sessions that ended, by the reason.", count, label)
    return "\n".join(lines) + "\n"
