"""MuJoCo's own log, which it keeps in the working directory."""

import mujoco


def silence() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the working directory, and to the terminal, in this process.

    Faults are in `State.fault`, errors of files and worlds are exceptions. A log file of another name was somebody's
    choice and stays.
    """
    config = mujoco.MjLogConfig.get()
    config.logto_console = False
    config.logto_file = config.logto_file and config.logfile != "MUJOCO_LOG.TXT"
    mujoco.MjLogConfig.set(config)
