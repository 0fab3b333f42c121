"""The contract suite of planners of motion: `pytest --pyargs anysim.testing.planners --planner NAME`.

A test's docstring is the rule that it checks. Tests of what the planner's `capabilities` do not claim are skipped and
counted. The worlds are made of balls, capsules and boxes, so that paths are judged by plain arithmetic, which shares
no line with what planners use.
"""
