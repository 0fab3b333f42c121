"""Peers as outside checks: the verdicts of ManiSkill and robosuite on states of anysim's tasks."""
