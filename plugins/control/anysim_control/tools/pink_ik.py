"""`pink_ik`: tools, posture and centre of mass weighed against each other in one quadratic program a control step."""

from anysim_control.tools.program import Costs, Program, ToolProgram


class PinkIk(ToolProgram):
    """Pink's frame tasks for all tools of the channel: both arms of a robot and its waist are one problem.

    Limits of positions and velocities are constraints, so they hold whatever the tasks ask for. Joints that follow
    others (mimic) stay coupled, and joints of other channels stand still at what is measured, as equality constraints.
    """

    def _made(self, costs: Costs) -> Program:
        from anysim_control.tools.pink_problem import PinkProblem

        return PinkProblem(self.frames, self.max_step, costs)
