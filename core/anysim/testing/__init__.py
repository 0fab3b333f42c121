"""The contract suite of physics engines, shipped for their authors: `pytest --pyargs anysim.testing --engine NAME`.

A test's docstring is the rule that it checks. Tests that need a capability the engine does not declare are skipped and
counted; what an engine declares is tested.

What judges engines outside of the suite is here too, and needs no pytest: `sketch` makes small Worlds by hand, `audit`
reads a World back from a live engine, and `kinematic` is an engine without physics.
"""
