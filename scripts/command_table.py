"""The reference of the built-in commands, from the skills' signatures, into docs/commands_and_episodes.md.

    python scripts/command_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import sys
from collections import Counter
from inspect import isclass

from generated import main
from term_table import described, row

from anysim import registry
from anysim.plugin_parameters import parameters
from anysim.skills.phases import MovingSkill

SHARED = 4
"""What at least so many commands have, in the same words, is described once."""


def commands() -> dict[str, type[MovingSkill]]:
    """The skills of this repository that can be commands, by name."""
    ours = [name for name in registry.names("skills") if registry.distribution("skills", name).startswith("anysim")]
    loaded = {name: registry.load("skills", name) for name in ours}
    return {name: made for name, made in loaded.items() if isclass(made) and issubclass(made, MovingSkill)}


def reference() -> str:
    """A list of the parameters that many commands have, then a table of the commands."""
    known = commands()
    often = Counter(described(*given) for made in dict.fromkeys(known.values()) for given in parameters(made).items())
    shared: dict[str, str] = {}
    for words, count in often.most_common():
        if count >= SHARED:
            shared.setdefault(words.partition(":")[0], words)
    lines = ["These parameters are the same in many commands, whose rows only name them:", ""]
    lines += [f"- {shared[key]}" for key in sorted(shared)]
    lines += ["", "| command | what it does | parameters |", "|---|---|---|"]
    own = {
        made: next(name for name in known if name.replace("_", "") == made.__name__.lower()) for made in known.values()
    }
    for name, made in sorted(known.items()):
        same = own[made] != name
        lines.append(f"| `{name}` | The same as `{own[made]}`. |  |" if same else row(name, made, shared.values()))
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main(__doc__, "commands", "command_table.py", ("docs/commands_and_episodes.md",), reference))
