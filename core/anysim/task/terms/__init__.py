"""The built-in library of terms. A name in YAML is a function here; its keyword-only arguments are its parameters.

Kinds, by the module they are in: observations `(scene) -> (n, k)`, rewards `(scene) -> (n,)`, predicates
`(scene) -> (n,) bool`, commands `(scene, draw) -> (n, 7)` goal poses, events `(scene, draw) -> None`.
"""

from anysim.task.terms import commands, events, observations, predicates, rewards

TERMS = {"observation": observations, "reward": rewards, "predicate": predicates, "command": commands, "event": events}
"""A library of terms maps each kind to the module or object that has its functions."""
