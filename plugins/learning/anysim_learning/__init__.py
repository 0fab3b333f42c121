"""Views of anysim for learners, and learners: gymnasium, Stable-Baselines3, rsl_rl, cloning."""
