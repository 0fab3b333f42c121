"""The example of the README says what the README says it says."""

import re
from pathlib import Path

README = Path(__file__).parents[2] / "schemas" / "README.md"


def test_the_example_runs(write, capsys):
    blocks = dict(re.findall(r"```(\w+)\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL))
    write(pick=blocks["yaml"], tabletop="world: {objects: {table: {source: {box: [1, 1, 0.1]}}}}")
    exec(compile(blocks["python"], "README.md", "exec"), {})
    assert capsys.readouterr().out == blocks["text"]
    write(pick=blocks["yaml"].replace("masss", "mass"))
    exec(compile(blocks["python"].replace("0.01", "0.012"), "README.md", "exec"), {})
    assert capsys.readouterr().out == "3\n-o physics.dt=0.004\n"
