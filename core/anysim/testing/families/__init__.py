"""The contract suite of families: `pytest --pyargs anysim.testing.families --family NAME --engine E`.

A test's docstring is the rule that it checks. `--family-option KEY=VALUE` gives parameters, as in a file.
"""
